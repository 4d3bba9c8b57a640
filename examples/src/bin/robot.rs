//! Flies a painting mission on an autopilot that speaks MAVLink.

use std::process::ExitCode;

use clap::Parser;
use paintcopter::exit::run_program;
use paintcopter::robot::{Arguments, run};

fn main() -> ExitCode {
    run_program("robot", || run(&Arguments::parse()))
}
