//! What the crate promises, against closed forms and recorded images. `own_*`: what each trait asks of whoever brings his own.

#![allow(clippy::unwrap_used, reason = "a test may panic, in its helpers too")]

mod accuracy;
#[cfg(feature = "pose-graph")]
mod bundle_adjustment;
mod calibration;
mod carve;
mod consistency;
mod degenerate;
mod distance_field;
mod errors;
mod evicted_views;
mod eviction;
mod examples;
mod global_registration;
#[cfg(feature = "gpu")]
mod gpu;
#[cfg(feature = "gpu")]
mod gpu_memory;
mod holes;
mod incremental;
#[cfg(feature = "pose-graph")]
mod loops;
mod map_file;
mod noisy_room;
#[cfg(feature = "pose-graph")]
mod own_frame_source;
mod own_layer;
mod own_map;
mod own_merge_policy;
#[cfg(feature = "pose-graph")]
mod pose_graph;
mod random;
mod recognition;
mod recorded;
mod relocalisation;
mod resumed;
mod reversible;
mod scene;
mod strange_motion;
mod topology;
mod tracking;
mod views;
mod worlds;
