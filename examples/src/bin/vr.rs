//! Painting by hand in a headset or a browser tab; the simulated robot follows.

use std::process::ExitCode;

use clap::Parser;
use paintcopter::exit::run_program;
use paintcopter::vr::{Arguments, run};

fn main() -> ExitCode {
    run_program("vr", || run(&Arguments::parse()))
}
