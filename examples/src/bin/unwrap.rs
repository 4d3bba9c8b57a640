//! Lays a mesh out as an atlas: charts, texture coordinates, textures.

use std::process::ExitCode;

use clap::Parser;
use paintcopter::exit::run_program;
use paintcopter::unwrap::{Arguments, run};

fn main() -> ExitCode {
    run_program("unwrap", || run(&Arguments::parse()))
}
