//! Pictures to sprays: paints one, compares painters, trains the network.

use std::process::ExitCode;

use clap::Parser;
use paintcopter::exit::exit_code;
use paintcopter::paint_image::{Arguments, run};

fn main() -> ExitCode {
    exit_code("paint-image", run(Arguments::parse()))
}
