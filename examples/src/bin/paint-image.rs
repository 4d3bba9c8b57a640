//! Pictures to sprays: paints one, compares painters, trains the network.

use std::process::ExitCode;

use clap::Parser;
use paintcopter_examples::paint_image::{Arguments, run};

fn main() -> ExitCode {
    match run(Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("paint-image: {error}");
            ExitCode::FAILURE
        }
    }
}
