//! Shared-control painting with a gantry robot that a person sweeps past an object.

use std::process::ExitCode;

use paintcopter::exit::run_program;
use paintcopter::handheld::run;

fn main() -> ExitCode {
    run_program("handheld", run)
}
