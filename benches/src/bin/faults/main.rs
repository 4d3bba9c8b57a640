//! Whether the tests of each crate see faults: those of `benches/faults/*.toml`, planted by hand, and mutants sampled from the lists of
//! `cargo mutants`. All are compiled at once into a scratch copy of the workspace, behind an environment variable; a first run of
//! every test notes which faults it reaches; then each fault is turned on by itself and the tests of its own crate that reach it
//! run, the quickest first, until one fails or hangs.
//!
//! Prints one table, a row a crate, and the faults that no test sees. The exit code is 1 if too few are seen.

mod any_error;
mod arguments;
mod blocks;
mod fault;
mod memory;
mod outcome;
mod scratch;
mod switch;
mod test_program;
mod tests;

use std::process::ExitCode;

use clap::Parser as _;

use any_error::AnyError;
use arguments::Arguments;
use memory::Memory;
use outcome::Outcome;
use scratch::Scratch;

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(2)
        }
    }
}

/// Whether as many faults are seen as must be.
fn run(arguments: &Arguments) -> Result<bool, AnyError> {
    let root = std::env::current_dir()?;
    let mut faults = fault::planted_by_hand(&root)?;
    faults.extend(fault::mutants(&root, arguments.mutants, &arguments.seeds)?);
    let scratch = Scratch::copy(&root, &arguments.folder(&root))?;
    let mut memory = Memory::read(&scratch.memory_file())?;
    let (compiled, mut programs) = scratch.compile(&faults, &mut memory)?;
    programs.retain(|program| arguments.tests(&program.krate));
    programs.sort_by_key(|program| (arguments.turn(&program.krate), program.krate.clone()));
    let mut outcomes = Vec::new();
    for own in programs.chunk_by(|a, b| a.krate == b.krate) {
        let chosen = (0..faults.len()).filter(|&id| faults[id].krate == own[0].krate && arguments.chooses(&faults[id]));
        let (switched, left_out): (Vec<usize>, Vec<usize>) = chosen.partition(|&id| compiled.contains(id));
        let switched: Vec<_> = switched.into_iter().map(|id| (id, memory.number(&faults[id]), &faults[id])).collect();
        let tests = tests::record(own, &scratch.reached_file(), arguments, &mut memory)?;
        memory.write(&scratch.memory_file())?;
        let ran = tests::run_all(&switched, &tests, &memory, arguments);
        for (id, outcome) in &ran {
            if let Outcome::Seen(test) = outcome {
                memory.seen.insert(faults[*id].key(), test.clone());
            }
        }
        memory.write(&scratch.memory_file())?;
        outcomes.extend(ran);
        outcomes.extend(left_out.into_iter().map(|id| (id, compiled.why_not(id))));
    }
    Ok(outcome::print(&faults, &outcomes))
}
