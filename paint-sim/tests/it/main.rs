//! What the crate promises, seen from outside. `own_*`: what each trait asks of whoever brings his own.
#![allow(clippy::unwrap_used, reason = "a test may fail by panicking")]

mod chart;
mod colour;
mod deposit;
mod droplets;
mod examples;
mod film_stack;
mod flight;
mod flight_scene;
mod flight_statistics;
mod gantry_robot;
mod gloss;
#[cfg(feature = "gpu")]
mod gpu;
mod inspection;
mod km;
mod levelling;
mod light;
mod multirotor;
mod own_controller;
mod own_pan_tilt;
mod own_reference;
mod own_surface;
mod render;
mod shadows;
mod spray_air;
mod spray_calibration;
mod spray_shape;
mod spray_wear;
mod surface;
mod wet;
