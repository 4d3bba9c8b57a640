//! The command line.

use std::path::{Path, PathBuf};

use clap::Parser;

use crate::fault::Fault;

/// Plants faults and runs the tests that must see them. Run it from the root of the workspace.
#[derive(Parser)]
pub(crate) struct Arguments {
    /// How many mutants to sample from the lists of `cargo mutants`, over all crates
    #[arg(long, default_value_t = 600)]
    pub(crate) mutants: usize,
    /// Seed of the sample; a sample for each, if given more than once
    #[arg(long = "seed", default_values_t = [1])]
    pub(crate) seeds: Vec<u64>,
    /// Only the faults and the tests of this crate (its folder); may be given more than once, and they run in that order
    #[arg(long = "crate")]
    crates: Vec<String>,
    /// Only the faults whose place or name contains one of these
    names: Vec<String>,
    /// Tests at a time
    #[arg(long, default_value_t = 2)]
    pub(crate) jobs: usize,
    /// Tests that take longer than this without a fault, in seconds, are left out
    #[arg(long, default_value_t = 600.0)]
    pub(crate) longest: f64,
    /// Folder of the copy and of what is built from it [default: target/faults]
    #[arg(long)]
    folder: Option<PathBuf>,
}

impl Arguments {
    /// Where the copy stands.
    pub(crate) fn folder(&self, root: &Path) -> PathBuf {
        self.folder.clone().unwrap_or_else(|| root.join("target").join("faults"))
    }

    /// Whether the tests of a crate run.
    pub(crate) fn tests(&self, krate: &str) -> bool {
        self.crates.is_empty() || self.crates.iter().any(|asked| asked == krate)
    }

    /// When it is a crate's turn.
    pub(crate) fn turn(&self, krate: &str) -> Option<usize> {
        self.crates.iter().position(|asked| asked == krate)
    }

    /// Whether a fault is asked for.
    pub(crate) fn chooses(&self, fault: &Fault) -> bool {
        self.tests(&fault.krate)
            && (self.names.is_empty() || self.names.iter().any(|n| fault.title().contains(n.as_str())))
    }
}
