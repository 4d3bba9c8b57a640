//! Lays a mesh out as an atlas: charts, texture coordinates, textures.

use std::process::ExitCode;

use paintcopter::exit::run_program;
use paintcopter::unwrap::run;

fn main() -> ExitCode {
    run_program("unwrap", run)
}
