//! Whole plans on analytic worlds.

mod control;
mod gantry;
mod plans;
mod session;
mod walls;
mod worlds;
