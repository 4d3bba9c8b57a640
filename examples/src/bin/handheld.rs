//! Shared-control painting with a gantry robot that a person sweeps past an object.

use std::process::ExitCode;

use clap::Parser;
use paintcopter_examples::handheld::{Arguments, run};

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("handheld: {error}");
            ExitCode::FAILURE
        }
    }
}
