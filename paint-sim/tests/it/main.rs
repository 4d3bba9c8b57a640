//! What the crate promises, seen from outside.
#![allow(clippy::unwrap_used, reason = "a test may fail by panicking")]

mod colour;
mod deposit;
mod droplets;
mod flight;
mod km;
mod render;
mod surface;
