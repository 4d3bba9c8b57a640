//! Maps a recorded RGB-D sequence: depth and colour images, with poses or without, become a map and a mesh.

use std::process::ExitCode;

use clap::Parser;
use paintcopter::exit::run_program;
use paintcopter::scan::{Arguments, execute};

fn main() -> ExitCode {
    run_program("scan", || execute(&Arguments::parse()))
}
