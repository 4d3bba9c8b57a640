//! Visual-inertial odometry from the command line: recordings of a camera and an inertial sensor become trajectories.

use std::process::ExitCode;

use paintcopter::exit::run_program;
use paintcopter::vio::execute;

fn main() -> ExitCode {
    run_program("vio", execute)
}
