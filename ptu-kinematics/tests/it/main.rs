//! What the crate promises, seen from outside.
#![allow(clippy::unwrap_used, reason = "a test may fail by panicking")]

mod kinematics;
mod pitching_ptu;
#[cfg(feature = "urdf")]
mod serial_arm;
mod servo;
#[cfg(feature = "urdf")]
mod urdf;
