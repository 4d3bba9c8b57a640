//! Painters: given the image that is wanted and the paint that is already there, what to spray where.
//!
//! A spray at pixel `μ` adds the depth `v exp(-|p - μ|² / 2σ²)` to the canvas `c`; what is seen is the ink `a = f(c)`, where `f`
//! saturates: `tanh` in the thesis, Beer-Lambert, or any rising curve, for instance one sampled from Kubelka-Munk.
//! Painting is then deconvolution with a sign: paint can be added, never taken away,
//!
//! ```text
//! min  ½ Σ_p w_p ( f(c₀ + G v)_p - y_p )²     subject to  0 ≤ v ≤ v_max
//! ```
//!
//! with `G` the matrix of footprints, `y` the wanted ink, `c₀` the paint already on the wall and `w` weights: a [`PaintProblem`].
//!
//! ```
//! use paint_net::{Deconvolution, Image, PaintProblem, Painter, SprayKernel, metrics};
//!
//! // A soft disc of ink on a bare wall.
//! let wanted = Image::from_fn(48, 48, |x, y| {
//!     let r = (x as f64 - 24.0).hypot(y as f64 - 24.0);
//!     0.7 / (1.0 + ((r - 12.0) / 1.5).exp())
//! });
//! let kernel = SprayKernel::new(2.0, 4.0)?;
//! let painting = Deconvolution::default().paint(&PaintProblem::new(&wanted).with_kernel(&kernel))?;
//! assert!(metrics::psnr(&painting.ink, &wanted, None)? > 35.0);
//! # Ok::<(), paint_net::Error>(())
//! ```
//!
//! Three levels of use: [`paint()`] in one call, a [`Painter`] on a [`PaintProblem`], and the trait [`Painter`] for a painter of
//! one's own, which the wrapping painters take like any other.
//!
//! | source | item |
//! |---|---|
//! | Paper IV, 3: reference, canvas, sprays | [`PaintProblem`], [`Painting`], [`Spray`] |
//! | Paper IV, 3.2: layers by intensity | [`painters::Layered`] |
//! | Paper IV, 3.3: spray footprint, ink `tanh c` | [`SprayKernel`], [`Saturation`] |
//! | Paper IV, 3.2: the "ideal", a Gaussian of the reference | [`ideal`] |
//! | Paper IV, 3.3: the network with READ, PAINT and a learned stop | [`thesis::ThesisPainter`], [`thesis::Network`] |
//! | non-negative deconvolution by projected L-BFGS | [`Deconvolution`] |
//! | the same with strokes along lines (thinning: Zhang and Suen 1984) | [`painters::Centrelines`] |
//! | rows whose width and direction follow the picture; ours | [`painters::AdaptiveRows`] |
//! | matching pursuit (Mallat and Zhang 1993) | [`painters::MatchingPursuit`] |
//! | few sprays at free positions, of free spreads | [`painters::FreeSprays`] |
//! | a feedback network (as Zamir et al. 2017), convolutional; ours: Paper IV paints one spray per step | [`Feedback`], [`network::Network`] |
//! | closed loop: coats, and a measurement after each; ours: Paper IV paints open loop | [`painters::ClosedLoopPainter`] |
//! | volumes fitted to what sprays leave on the surface itself, curved, stretched and cut; ours | [`OnSurface`] |
//! | doses of a coat, least squares on thickness (Daube-Witherspoon and Muehllehner 1986) | [`painters::DoseCorrection`] |
//! | a valve of limited slew rate (augmented Lagrangian), on a context-based path (Dafner et al. 2000) | [`painters::SlewLimited`], [`path::ScanOrder`] |
//! | several paints that mix (Kubelka and Munk 1931) | [`colour::Palette`], [`colour::ColourSeparation`] |
//! | separation by any mixing model, paints chosen and ordered, all sprays at once; ours | [`colour::TexelSeparation`], [`colour::choose_paints`], [`colour::ColourFit`] |
//! | each paint only where it is needed (reweighted ℓ1 for groups: Candès, Wakin, Boyd 2008) | [`colour::SparseColourFit`] |
//! | strokes a robot can fly | [`path::boustrophedon`], [`path::in_order`] |
//!
//! Pixels: centres at integers, `x` = column, `y` = row, row 0 at the top. Lengths are in pixels, depths in the unit of the
//! saturation curve. Every result is the same bytes for the same input.
//!
//! | feature | brings |
//! |---|---|
//! | `train` | training of both networks, `train` |
//! | `serde` | settings and results can be stored |
//! | `tracing` | spans and events for subscribers of `tracing` |

pub mod colour;
mod error;
mod ideal;
mod image;
pub mod metrics;
pub mod model;
mod nearby;
pub mod network;
mod optimise;
mod painter;
pub mod painters;
mod painting;
pub mod path;
pub mod problem;
pub mod procedural;
pub mod thesis;
mod trace;
#[cfg(feature = "train")]
pub mod train;

pub use error::Error;
pub use ideal::ideal;
pub use image::Image;
pub use model::{Saturation, Spray, SprayKernel};
pub use painter::{Observer, Painter};
pub use painters::{Deconvolution, Feedback, OnSurface};
pub use painting::Painting;
pub use problem::{Limits, PaintProblem};

/// Paints an image in one call: wanted ink in `[0, 1]`, by the feedback network with its shipped weights, on a bare wall, with
/// the thesis' nozzle and `tanh`.
pub fn paint(wanted: &Image) -> Result<Painting, Error> {
    Feedback::shipped()?.paint(&PaintProblem::new(wanted))
}

/// The examples of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
