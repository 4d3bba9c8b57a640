//! The odometry as people run it.

pub(crate) mod fixtures;
mod recordings;
mod runs;
