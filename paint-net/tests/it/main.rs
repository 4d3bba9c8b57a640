//! What the crate promises, seen from outside. `own_*`: what each trait asks of whoever brings his own.
#![allow(clippy::unwrap_used, reason = "a test may fail by panicking")]

mod adaptive_rows;
mod colour;
mod doses;
mod examples;
mod feedback;
mod free_sprays;
mod line_art;
mod on_surface;
mod own_observer;
mod own_painter;
mod painters;
mod promises;
mod reference;
#[cfg(feature = "train")]
mod separation;
mod thesis;
#[cfg(feature = "train")]
mod train;
mod wrapping;
