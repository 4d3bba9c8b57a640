//! Visual-inertial odometry from the command line: recordings of a camera and an inertial sensor become trajectories.

use std::process::ExitCode;

use clap::Parser;
use paintcopter_examples::exit::exit_code;
use paintcopter_examples::vio::{Arguments, execute};

fn main() -> ExitCode {
    exit_code("vio", execute(&Arguments::parse()))
}
