//! Sprays a recorded motion of a nozzle onto a mesh.

use std::process::ExitCode;

use paintcopter::exit::run_program;
use paintcopter::spray::run;

fn main() -> ExitCode {
    run_program("spray", run)
}
