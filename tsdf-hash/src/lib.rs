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
//! ```
//! use nalgebra::{Isometry3, Point3};
//! use tsdf_hash::{DepthData, DepthView, Intrinsics, Map, Settings};
//!
//! // A wall one metre in front of the camera, which looks along z.
//! let depth = vec![1000_u16; 160 * 120];
//! let intrinsics = Intrinsics { fx: 130.0, fy: 130.0, cx: 79.5, cy: 59.5 };
//! let view = DepthView { width: 160, height: 120, data: DepthData::U16 { data: &depth, scale: 1000.0 }, intrinsics };
//! let mut map = Map::new(Settings::default())?;
//! map.integrate(&view, None, &Isometry3::identity())?;
//! let distance = map.distance(&Point3::new(0.0, 0.0, 0.98)).ok_or("unseen")?;
//! assert!((distance - 0.02).abs() < 1e-5);
//! assert!(map.mesh().positions.iter().all(|p| (p[2] - 1.0).abs() < 1e-5));
//! map.deintegrate(&view, None, &Isometry3::identity())?;
//! assert_eq!(map.blocks(), 0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! | what | where it comes from | item |
//! |---|---|---|
//! | voxel hashing, a budget of memory | thesis Paper I, section 4.3 | [`Map`], [`Settings::max_bytes`] |
//! | eviction and reloading, regions (a)-(d) | thesis Paper I, section 4.3; copies as partial sums: ours | [`MemoryLimits`], [`Map::with_swap`], [`MemoryUsage`] |
//! | reloaded blocks are not fused before drift is known | thesis Paper I, section 4.5 | [`ReloadedBlocks`], [`MergePolicy`], [`Map::merge_reloaded`] |
//! | a map is stored, loaded and continued | thesis Paper II, section 6.1 | [`Map::save`], [`Map::open`], [`MapFile`] |
//! | one map for another | | [`DenseMap`] |
//! | a layer of voxel blocks, as voxblox has it | Oleynikova et al. 2017 | [`TsdfLayer`], [`BlockReader`], [`VoxelBlock`] |
//! | integration of depth and colour | thesis Paper I, section 4.3, step (b); sums instead of averages: ours | [`Map::integrate`] |
//! | deintegration | Dai et al. 2017; exact by integer sums: ours | [`Map::deintegrate`] |
//! | noise and weights | Nguyen, Izadi, Lovell 2012; `w = 15 (σ₀/σ(z))² cos θ`: ours | [`NoiseModel`] |
//! | mesh | thesis Paper I, section 4.6, by marching cubes; case table derived: ours | [`Map::mesh`], [`write_ply`] |
//! | the same bytes on a GPU | ours | `GpuMap` (feature `gpu`) |
//! | the mesh of a growing map, evicted blocks included | thesis Paper I, section 4.6 | [`IncrementalMesher`] |
//! | a surface seen from a pose | thesis Paper I, section 4.1 | [`Map::ray_cast`], [`View`], [`Map::cast`] |
//! | tracking: Eqs. (5.2) and (5.3), coarse to fine; degenerate directions: ours | thesis Paper I, section 4.1 | [`Tracker`], [`TrackingOutcome`] |
//! | `R(v) = α n/n_max + β (1 − abs(sdf)/μ)`, Eqs. (5.4)-(5.6) | thesis Paper I, section 4.4, corrected | [`IncrementalRayCast`] |
//! | forward projection of a view between ray casts | thesis Paper I, section 6.2 | [`View::warped`] |
//! | places found again by binary features and a vocabulary tree | thesis Paper I, section 4.5 | [`KeyframeIndex::recognise`], [`Vocabulary`] |
//! | pose graph: Levenberg-Marquardt on SE(3) | thesis Paper I, section 4.6 | `PoseGraph` (feature `pose-graph`) |
//! | distance queries | thesis, outlook | [`Map::distance`], [`Map::distance_and_gradient`] |
//! | distances for planners, far from surfaces | thesis, outlook; branch and bound over sites: ours | [`DistanceField`] |
//!
//! Frames: the camera's z looks forward, `x` to the right and `y` down in its image; the world is the caller's. Distances
//! are positive on the camera's side of a surface. Metres.

mod blocks;
#[cfg(feature = "pose-graph")]
mod bundle_adjustment;
mod changes;
mod codec;
mod dense_map;
mod derived_blocks;
mod device_map;
mod distance_field;
mod error;
mod file;
mod frame_clock;
#[cfg(feature = "gpu")]
mod gpu;
mod hashing;
mod images;
mod integration;
mod keyframes;
#[cfg(feature = "pose-graph")]
mod loop_closure;
mod map;
mod mesh;
mod parallel;
mod place_recognition;
#[cfg(feature = "pose-graph")]
mod pose_graph;
mod ray_cast;
mod report;
mod rounding;
mod settings;
pub mod slam;
mod storage;
mod trace;
mod tracking;
mod tsdf_layer;

/// The recipe of the README, as a test.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
pub struct Readme;

pub use blocks::voxel_block::VoxelBlock;
#[cfg(feature = "pose-graph")]
pub use bundle_adjustment::adjust::{BundleAdjustmentReport, bundle_adjust};
#[cfg(feature = "pose-graph")]
pub use bundle_adjustment::settings::BundleAdjustmentSettings;
pub use changes::{BlockChanges, MapVersion};
pub use codec::{decode_block, encode_block};
pub use dense_map::DenseMap;
pub use derived_blocks::UpdateReport;
pub use distance_field::field::DistanceField;
pub use distance_field::settings::DistanceSettings;
pub use error::{BoxedError, Error};
pub use file::map_file::MapFile;
#[cfg(feature = "gpu")]
pub use gpu::gpu_map::GpuMap;
#[cfg(feature = "gpu")]
pub use gpu::options::GpuOptions;
pub use images::{ColourData, ColourView, DepthData, DepthView, Intrinsics};
pub use keyframes::index::{KeyframeIndex, KeyframeMatch, RecognisedPlace};
#[cfg(feature = "pose-graph")]
pub use loop_closure::closer::LoopCloser;
#[cfg(feature = "pose-graph")]
pub use loop_closure::report::{LoopClosure, LoopReport};
#[cfg(feature = "pose-graph")]
pub use loop_closure::settings::LoopSettings;
pub use map::Map;
pub use mesh::deformation::EmbeddedDeformation;
pub use mesh::incremental::IncrementalMesher;
pub use mesh::obj::write_obj;
pub use mesh::patches::PatchKey;
pub use mesh::ply::write_ply;
pub use mesh::triangle_mesh::Mesh;
pub use nalgebra;
pub use place_recognition::vocabulary::Vocabulary;
#[cfg(feature = "pose-graph")]
pub use pose_graph::factors::{BetweenFactor, PriorFactor};
#[cfg(feature = "pose-graph")]
pub use pose_graph::graph::PoseGraph;
#[cfg(feature = "pose-graph")]
pub use pose_graph::levenberg_marquardt::{PoseGraphReport, PoseGraphSettings};
#[cfg(feature = "pose-graph")]
pub use pose_graph::robust_kernel::RobustKernel;
pub use ray_cast::depth_comparison::DepthComparison;
pub use ray_cast::incremental::{IncrementalRayCast, IncrementalRayCastSettings};
pub use ray_cast::settings::RayCastSettings;
pub use ray_cast::single_ray::SurfaceHit;
pub use ray_cast::view::View;
pub use report::{FrameReport, MemoryUsage};
pub use settings::{MemoryLimits, NoiseModel, Settings};
pub use storage::merge_policy::{MergeDecision, MergeImmediately, MergePolicy};
pub use storage::reloaded::ReloadedBlocks;
pub use tracking::drift::Drift;
pub use tracking::outcome::{PosePrior, TrackingOutcome, TrackingStatus};
pub use tracking::relocaliser::{Relocalisation, Relocaliser};
pub use tracking::settings::TrackingSettings;
pub use tracking::tracker::Tracker;
pub use tsdf_layer::{BlockReader, TsdfLayer};
