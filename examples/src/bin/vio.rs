//! Visual-inertial odometry from the command line: recordings of a camera and an inertial sensor become trajectories.

use std::process::ExitCode;

use clap::Parser;
use paintcopter::exit::exit_code;
use paintcopter::vio::{Arguments, execute};

fn main() -> ExitCode {
    exit_code("vio", execute(&Arguments::parse()))
}
