//! The tests that there are, and what they reach.

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::time::Duration;

use serde::{Deserialize, Serialize};

/// A program of tests of one crate.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Program {
    pub(crate) krate: String,
    pub(crate) path: PathBuf,
    pub(crate) folder: PathBuf,
}

/// A test that passes without a fault.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Test {
    pub(crate) program: Program,
    pub(crate) name: String,
    /// Without a fault.
    pub(crate) time: Duration,
    /// Numbers of the faults whose code it runs.
    pub(crate) reaches: BTreeSet<u32>,
}
