//! Shared-control painting with a gantry robot that a person sweeps past an object.

use std::process::ExitCode;

use clap::Parser;
use paintcopter::exit::exit_code;
use paintcopter::handheld::{Arguments, run};

fn main() -> ExitCode {
    exit_code("handheld", run(&Arguments::parse()))
}
