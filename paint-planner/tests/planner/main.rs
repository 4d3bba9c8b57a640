//! Whole plans on analytic worlds.

mod constraints;
mod continuation;
mod control;
mod gantry;
mod plans;
mod session;
mod transits;
mod walls;
mod worlds;
