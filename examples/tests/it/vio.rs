//! The odometry as people run it.

mod fixtures;
mod recordings;
mod runs;
