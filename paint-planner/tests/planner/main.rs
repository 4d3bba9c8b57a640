//! Whole plans on analytic worlds.

mod plans;
mod walls;
mod worlds;
