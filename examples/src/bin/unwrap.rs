//! Lays a mesh out as an atlas: charts, texture coordinates, textures.

use std::process::ExitCode;

use clap::Parser;
use paintcopter_examples::unwrap::{Arguments, run};

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("unwrap: {error}");
            ExitCode::FAILURE
        }
    }
}
