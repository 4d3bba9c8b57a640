//! Metric parametrization of triangle meshes: a scanned surface is laid out in the plane so that lengths stay true, cut into
//! texels, textured, and every point of the plane knows its place on the surface and the pose of a spray gun that paints it
//! (thesis, chapter 8). The layout minimises the as-rigid-as-possible energy
//!
//! `E(u, R) = sum_t A_t |J_t(u) - R_t|^2`
//!
//! over the uv points `u` and one rotation `R_t` per triangle, where `J_t` is the 2x2 map from the triangle's own plane to the
//! chart; where that energy folds triangles over, the symmetric Dirichlet energy takes its place, which cannot. Surfaces too
//! far from flat for one piece, such as busts, are cut open where the distortion is high ([`unwrap_with_cuts`]); surfaces of any
//! topology are taken apart into few charts, each within a bound of stretch ([`unwrap_atlas`]).
//!
//! ```
//! use uv_param::nozzle::{NozzleSettings, nozzle_command};
//! use uv_param::texture::TexelMap;
//! use uv_param::{Settings, largest_disk, unwrap};
//!
//! // A 2 m x 1 m wall with a right-angled fold, z up.
//! let positions = [[0., 0., 0.], [1., 0., 0.], [1., 1., 0.], [0., 0., 1.], [1., 0., 1.], [1., 1., 1.]];
//! let faces = [[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]];
//! let (disk, _left_out) = largest_disk(&positions, &faces)?;
//! let settings = Settings { up: Some([0.0, 0.0, 1.0]), ..Settings::default() };
//! let chart = unwrap(&disk, &settings, |_progress| ())?;
//! assert!((chart.width() - 2.0).abs() < 1e-9 && (chart.height() - 1.0).abs() < 1e-9);
//! let texels = TexelMap::new(&chart, 0.0125)?;
//! assert_eq!((texels.width, texels.height), (160, 80));
//! let nozzle = nozzle_command(&chart, [0.5, 0.25], &NozzleSettings::default())?;
//! assert!((nozzle.point.z - 0.25).abs() < 1e-9);
//! # Ok::<(), uv_param::Error>(())
//! ```
//!
//! | equation | item |
//! |---|---|
//! | Liu et al. 2008, local/global ARAP | [`unwrap`], [`parametrizer::Arap`] |
//! | Peng et al. 2018, Anderson acceleration of the iteration | [`parametrizer::Arap`] |
//! | Smith and Schaefer 2015, symmetric Dirichlet energy | [`parametrizer::SymmetricDirichlet`] |
//! | thesis 8, "cuts along high distortion areas"; Gu et al. 2002, cut to the worst distortion | [`unwrap_with_cuts`], [`Disk::cut`] |
//! | Cohen-Steiner et al. 2004, regions of similar normals; merged within a bound of stretch (ours) | [`unwrap_atlas`] |
//! | Zheng et al. 2011, Eq. (3), bilateral normals; a part of a mesh up to its creases (ours) | [`region::grow_to_creases`] |
//! | Fu et al. 2008, the side on which a thing stands; meshes far from their origin; units (ours) | [`surface::file_frame`] |
//! | Tutte 1963, barycentric layout | [`parametrizer::Tutte`] |
//! | a map of your own | [`Parametrizer`], [`unwrap_by`] |
//! | thesis 8.3.1, box of smallest area by rotating calipers | [`min_area_rectangle::min_area_rectangle`], [`Chart::new`] |
//! | thesis 8.3.1, 1 px = 1.25 cm texture | [`texture::TexelMap`], [`texture::Texture`] |
//! | thesis Eq. (8.1), `p_3D = sum b_i V_i` | [`Chart::locate`], [`Chart::point`] |
//! | thesis Eq. (8.1), `n`, `w_dir`, `w_pos` | [`nozzle::nozzle_command`] |
//!
//! | feature | brings |
//! |---|---|
//! | `serde` | settings and results can be stored |
//! | `tracing` | spans and events for subscribers of `tracing` |

pub mod atlas;
pub mod chart;
mod clip;
pub mod cut;
mod decimate;
pub mod disk;
mod error;
mod half_edges;
mod laplacian;
mod linear;
pub mod min_area_rectangle;
pub mod nozzle;
pub mod parametrizer;
mod polygon_soup;
mod random;
pub mod region;
pub mod surface;
pub mod texture;
mod trace;
mod triangle;
mod unfold;
mod unwrap;

pub use atlas::{Atlas, AtlasSettings, unwrap_atlas};
pub use chart::{Chart, SurfacePoint};
pub use cut::unwrap_with_cuts;
pub use disk::{Disk, largest_disk};
pub use error::Error;
pub use nalgebra;
pub use parametrizer::Parametrizer;
pub use unwrap::{Method, Settings, unwrap, unwrap_by};

/// The recipe of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
