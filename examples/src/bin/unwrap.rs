//! Lays a mesh out as an atlas: charts, texture coordinates, textures.

use std::process::ExitCode;

use clap::Parser;
use paintcopter::exit::exit_code;
use paintcopter::unwrap::{Arguments, run};

fn main() -> ExitCode {
    exit_code("unwrap", run(&Arguments::parse()))
}
