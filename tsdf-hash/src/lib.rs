//! Dense mapping: a voxel-hashed truncated signed distance field with exactly reversible fusion, and its mesh.
//!
//! Depth images with known poses are fused into blocks of 8³ voxels, allocated only near surfaces and found through a
//! hash table. A voxel keeps sums of integers instead of a running average,
//!
//! ```text
//! S = Σ w q,    W = Σ w,    q = round(32767 clamp(d / μ, −1, 1)),    distance = μ S / (32767 W)
//! ```
//!
//! where `d` is the distance of the voxel from the plane seen at its pixel and `w` an integer in `1..=15`. Both depend on
//! the frame and its pose only, so the order of the frames and the number of threads leave no trace, and any frame can be
//! taken out again, to the bit: when poses are corrected, the map follows.
//!
//! [`slam::Slam`] is the whole of it: frames in; trajectory, map, mesh and keyframes out. [`Map`] is the map alone, for poses that are known.
//!
//! ```
//! use nalgebra::{Isometry3, Point3};
//! use tsdf_hash::slam::{PoseSource, Slam, SlamSettings};
//! use tsdf_hash::{DepthData, DepthView, Intrinsics};
//!
//! // A wall one metre in front of the camera, which looks along z and moves to the right.
//! let depth = vec![1000_u16; 160 * 120];
//! let intrinsics = Intrinsics { fx: 130.0, fy: 130.0, cx: 79.5, cy: 59.5 };
//! let view = DepthView { width: 160, height: 120, data: DepthData::U16 { data: &depth, scale: 1000.0 }, intrinsics };
//! // A bare wall does not fix a pose: it is given. `PoseSource::Tracked`, the default, finds it.
//! let mut slam = Slam::new(SlamSettings { poses: PoseSource::Given, ..SlamSettings::default() })?;
//! for k in 0..3 {
//!     slam.frame(f64::from(k) / 30.0, &view, None, Some(&Isometry3::translation(0.02 * f64::from(k), 0.0, 0.0)))?;
//! }
//! let mut state = slam.finish()?;
//! let distance = state.map.distance(&Point3::new(0.0, 0.0, 0.98)).ok_or("unseen")?;
//! assert!((distance - 0.02).abs() < 1e-5);
//! assert!(state.map.mesh().positions.iter().all(|p| (p[2] - 1.0).abs() < 1e-5));
//! for (_, world_from_camera) in &state.trajectory {
//!     state.map.deintegrate(&view, None, world_from_camera)?; // as if it had never been seen
//! }
//! assert_eq!(state.map.blocks(), 0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! | what | where it comes from | item |
//! |---|---|---|
//! | the system as a whole | thesis Paper I, algorithm 1 | [`slam::Slam`] |
//! | voxel hashing, a budget of memory | thesis Paper I, section 4.3 | [`Map`], [`Settings::max_bytes`] |
//! | eviction and reloading, regions (a)-(d) | thesis Paper I, section 4.3; copies as partial sums: ours | [`storage::MemoryLimits`], [`Map::with_swap`], [`storage::MemoryUsage`] |
//! | reloaded blocks are not fused before drift is known | thesis Paper I, section 4.5 | [`storage::ReloadedBlocks`], [`storage::MergePolicy`], [`Map::merge_reloaded`] |
//! | a map is stored, loaded and continued | thesis Paper II, section 6.1 | [`Map::save`], [`Map::open`], [`storage::MapFile`] |
//! | one map for another | | [`DenseMap`] |
//! | a layer of voxel blocks, as voxblox has it | Oleynikova et al. 2017 | [`layer::TsdfLayer`], [`layer::BlockReader`], [`layer::VoxelBlock`] |
//! | integration of depth and colour | thesis Paper I, section 4.3, step (b); sums instead of averages: ours | [`Map::integrate`] |
//! | deintegration | Dai et al. 2017; exact by integer sums: ours | [`Map::deintegrate`] |
//! | noise and weights | Nguyen, Izadi, Lovell 2012; `w = 15 (σ₀/σ(z))² cos θ`: ours | [`NoiseModel`] |
//! | mesh | thesis Paper I, section 4.6, by marching cubes; case table derived: ours | [`Map::mesh`], [`mesh::write_ply`] |
//! | the same bytes on a GPU | ours | `gpu::GpuMap` (feature `gpu`) |
//! | the mesh of a growing map, evicted blocks included | thesis Paper I, section 4.6 | [`mesh::IncrementalMesher`] |
//! | a surface seen from a pose | thesis Paper I, section 4.1 | [`Map::ray_cast`], [`ray_cast::View`], [`Map::cast`] |
//! | tracking: Eqs. (5.2) and (5.3), coarse to fine; degenerate directions: ours | thesis Paper I, section 4.1 | [`tracking::Tracker`], [`tracking::TrackingOutcome`] |
//! | `R(v) = α n/n_max + β (1 − abs(sdf)/μ)`, Eqs. (5.4)-(5.6) | thesis Paper I, section 4.4, corrected | [`ray_cast::IncrementalRayCast`] |
//! | forward projection of a view between ray casts | thesis Paper I, section 6.2 | [`ray_cast::View::warped`] |
//! | places found again by binary features and a vocabulary tree | thesis Paper I, section 4.5 | [`place_recognition::KeyframeIndex::recognise`], [`place_recognition::Vocabulary`] |
//! | pose graph: Levenberg-Marquardt on SE(3) | thesis Paper I, section 4.6 | `pose_graph::PoseGraph` (feature `pose-graph`) |
//! | distance queries | thesis, outlook | [`Map::distance`], [`Map::distance_and_gradient`] |
//! | distances for planners, far from surfaces | thesis, outlook; branch and bound over sites: ours | [`distance_field::DistanceField`] |
//!
//! Frames: the camera's z looks forward, `x` to the right and `y` down in its image; the world is the caller's. Distances
//! are positive on the camera's side of a surface. Metres.
//!
//! | feature | brings |
//! |---|---|
//! | `gpu` | the map on a GPU, `gpu::GpuMap` (wgpu) |
//! | `pose-graph` | pose graphs, `pose_graph` (faer's sparse Cholesky), and what closes loops by them |
//! | `serde` | settings and results can be stored |
//! | `tracing` | spans and events for subscribers of `tracing` |

mod blocks;
#[cfg(feature = "pose-graph")]
mod bundle_adjustment;
mod changes;
mod codec;
mod dense_map;
mod derived_blocks;
mod device_map;
pub mod distance_field;
mod error;
mod file;
mod frame_clock;
pub mod global_registration;
#[cfg(feature = "gpu")]
pub mod gpu;
mod hashing;
mod images;
mod integration;
mod keyframes;
pub mod layer;
#[cfg(feature = "pose-graph")]
pub mod loop_closure;
mod map;
pub mod mesh;
mod parallel;
pub mod place_recognition;
#[cfg(feature = "pose-graph")]
pub mod pose_graph;
pub mod ray_cast;
mod report;
mod rounding;
mod settings;
pub mod slam;
pub mod storage;
mod trace;
pub mod tracking;
mod widest;

/// The recipe of the README, as a test.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
pub struct Readme;

pub use dense_map::DenseMap;
pub use derived_blocks::UpdateReport;
pub use error::Error;
pub use images::{ColourData, ColourView, DepthData, DepthView, Intrinsics};
pub use map::Map;
pub use nalgebra;
pub use report::FrameReport;
pub use settings::{NoiseModel, Settings};
