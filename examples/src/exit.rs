//! How a program begins and ends.

use std::fmt::Display;
use std::process::ExitCode;

use crate::{interruption, run_folder};

/// Runs a program; an error is told in one line that begins with its name. The exit code is 0 where the result is usable, 1 where not, and
/// [`interruption::EXIT_CODE`] where somebody has ended it, whatever there is then.
pub fn run_program<E: Display>(program: &str, run: impl FnOnce() -> Result<(), E>) -> ExitCode {
    interruption::watch(program);
    let result = run();
    run_folder::end();
    if let Err(error) = &result {
        eprintln!("{program}: {error}");
    }
    match result {
        _ if interruption::is_requested() => interruption::EXIT_CODE.into(),
        Ok(()) => ExitCode::SUCCESS,
        Err(_) => ExitCode::FAILURE,
    }
}
