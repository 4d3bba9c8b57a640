//! Painting by hand in a headset or a browser tab; the simulated robot follows.

use std::process::ExitCode;

use clap::Parser;
use paintcopter::exit::exit_code;
use paintcopter::vr::{Arguments, run};

fn main() -> ExitCode {
    exit_code("vr", run(&Arguments::parse()))
}
