//! What the crate promises, seen from outside.
#![allow(clippy::unwrap_used, reason = "a test may fail by panicking")]

mod colour;
mod feedback;
mod free_sprays;
mod on_surface;
mod own_painter;
mod painters;
mod promises;
mod reference;
#[cfg(feature = "train")]
mod thesis;
#[cfg(feature = "train")]
mod train;
mod wrapping;
