//! Reruns the tables of the papers beside ours and writes them as the book shows them.

use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use clap::Parser;
use paintcopter_benches::results::{Extent, PARTS, write};

/// Reruns the tables and curves of the papers beside ours, in the order of the papers: data as CSV, and the pieces of the book's pages that
/// are made of it. `python docs/plots/plots.py` draws the curves.
#[derive(Parser)]
#[command(after_help = "Example:\n  cargo run --release -p paintcopter-benches --bin results -- --only planners")]
struct Arguments {
    /// Only the part of this name
    #[arg(long, value_name = "PART", value_parser = PARTS.map(|(name, _)| name))]
    only: Option<String>,
    /// As little as tells that each part runs: a wind, 32 scenarios, one configuration
    #[arg(long)]
    quick: bool,
    /// Folder to write into [default: docs/src/generated of the book; with --quick out/results]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("results: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    let (extent, usual) = if arguments.quick {
        (Extent::Quick, PathBuf::from("out/results"))
    } else {
        (Extent::Whole, Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/src/generated"))
    };
    let folder = arguments.out.as_ref().unwrap_or(&usual);
    let scratch = std::env::temp_dir().join(format!("paintcopter-results-{}", std::process::id()));
    let chosen = PARTS.iter().filter(|(name, _)| arguments.only.as_deref().is_none_or(|only| only == *name));
    let done = chosen.into_iter().try_for_each(|(name, rerun)| {
        let clock = Instant::now();
        let tables = rerun(extent, &scratch).map_err(|error| format!("{name}: {error}"))?;
        write(name, &tables, folder)?;
        println!("{name}: {:.0} s, {}", clock.elapsed().as_secs_f64(), folder.join(format!("{name}.md")).display());
        Ok(())
    });
    // Nothing is there where no part needed it.
    let _ = std::fs::remove_dir_all(&scratch);
    done
}
