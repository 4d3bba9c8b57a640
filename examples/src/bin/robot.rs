//! Flies a painting mission on an autopilot that speaks MAVLink.

use std::process::ExitCode;

use paintcopter::exit::run_program;
use paintcopter::robot::run;

fn main() -> ExitCode {
    run_program("robot", run)
}
