//! Pictures to sprays: paints one, compares painters, trains the network.

use std::process::ExitCode;

use paintcopter::exit::run_program;
use paintcopter::paint_image::run;

fn main() -> ExitCode {
    run_program("paint-image", run)
}
