//! What the crate promises, against closed forms and recorded images.

#![allow(clippy::unwrap_used, reason = "a test may panic, in its helpers too")]

mod accuracy;
mod carve;
mod distance_field;
mod errors;
mod eviction;
#[cfg(feature = "gpu")]
mod gpu;
mod holes;
mod incremental;
mod layers;
mod map_file;
mod random;
mod recorded;
mod reversible;
mod scene;
mod topology;
mod tracking;
mod views;
