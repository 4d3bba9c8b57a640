//! Whole plans on analytic worlds.

mod gantry;
mod plans;
mod walls;
mod worlds;
