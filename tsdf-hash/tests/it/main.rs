//! What the crate promises, against closed forms and recorded images.

#![allow(clippy::unwrap_used, reason = "a test may panic, in its helpers too")]

mod accuracy;
#[cfg(feature = "pose-graph")]
mod bundle_adjustment;
mod carve;
mod consistency;
mod distance_field;
mod errors;
mod eviction;
#[cfg(feature = "gpu")]
mod gpu;
mod holes;
mod incremental;
mod layers;
#[cfg(feature = "pose-graph")]
mod loops;
mod map_file;
mod noisy_room;
#[cfg(feature = "pose-graph")]
mod pose_graph;
mod random;
mod recognition;
mod recorded;
mod relocalisation;
mod reversible;
mod scene;
mod topology;
mod tracking;
mod views;
