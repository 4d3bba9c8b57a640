//! Shared-control painting with a gantry robot that a person sweeps past an object.

use std::process::ExitCode;

use clap::Parser;
use paintcopter::exit::run_program;
use paintcopter::handheld::{Arguments, run};

fn main() -> ExitCode {
    run_program("handheld", || run(&Arguments::parse()))
}
