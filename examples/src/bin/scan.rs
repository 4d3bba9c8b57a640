//! Maps a recorded RGB-D sequence: depth and colour images, with poses or without, become a map and a mesh.

use std::process::ExitCode;

use paintcopter::exit::run_program;
use paintcopter::scan::execute;

fn main() -> ExitCode {
    run_program("scan", execute)
}
