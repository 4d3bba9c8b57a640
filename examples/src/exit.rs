//! How a program ends.

use std::fmt::Display;
use std::process::ExitCode;

/// The exit code for what a program has come to; an error is told in one line that begins with the program's name.
pub fn exit_code<E: Display>(program: &str, result: Result<(), E>) -> ExitCode {
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{program}: {error}");
            ExitCode::FAILURE
        }
    }
}
