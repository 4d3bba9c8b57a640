//! Whole plans on analytic worlds.

mod gantry;
mod plans;
mod session;
mod walls;
mod worlds;
