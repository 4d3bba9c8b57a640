//! What the crate promises, against closed forms and recorded images.

#![allow(clippy::unwrap_used, reason = "a test may panic, in its helpers too")]

mod accuracy;
mod carve;
mod edf;
mod errors;
mod file;
#[cfg(feature = "gpu")]
mod gpu;
mod incremental;
mod recorded;
mod remap;
mod reversible;
mod scene;
mod tiers;
mod timing;
mod topology;
