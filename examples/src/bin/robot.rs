//! Flies a painting mission on an autopilot that speaks MAVLink.

use std::process::ExitCode;

use clap::Parser;
use paintcopter::exit::exit_code;
use paintcopter::robot::{Arguments, run};

fn main() -> ExitCode {
    exit_code("robot", run(&Arguments::parse()))
}
