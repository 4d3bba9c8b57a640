//! Painting by hand in a headset or a browser tab; the simulated robot follows.

use std::process::ExitCode;

use paintcopter::exit::run_program;
use paintcopter::vr::run;

fn main() -> ExitCode {
    run_program("vr", run)
}
