//! What the crate promises, seen from outside. `own_*`: what the trait asks of whoever brings his own.
#![allow(clippy::unwrap_used, reason = "a test may fail by panicking")]

mod examples;
mod kinematics;
mod own_chain;
mod pitching_ptu;
#[cfg(feature = "urdf")]
mod serial_arm;
mod servo;
#[cfg(feature = "urdf")]
mod urdf;
