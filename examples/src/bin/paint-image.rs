//! Pictures to sprays: paints one, compares painters, trains the network.

use std::process::ExitCode;

use clap::Parser;
use paintcopter_examples::exit::exit_code;
use paintcopter_examples::paint_image::{Arguments, run};

fn main() -> ExitCode {
    exit_code("paint-image", run(Arguments::parse()))
}
