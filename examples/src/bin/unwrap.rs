//! Lays a mesh out as an atlas: charts, texture coordinates, textures.

use std::process::ExitCode;

use clap::Parser;
use paintcopter_examples::exit::exit_code;
use paintcopter_examples::unwrap::{Arguments, run};

fn main() -> ExitCode {
    exit_code("unwrap", run(&Arguments::parse()))
}
