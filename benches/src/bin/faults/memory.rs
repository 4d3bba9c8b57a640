//! What a run leaves for the next one, so that it takes less time; all of it may be thrown away.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use serde::{Deserialize, Serialize};

use crate::any_error::AnyError;
use crate::fault::Fault;
use crate::test_program::Test;

/// Kept beside the copy of the workspace.
#[derive(Default, Serialize, Deserialize)]
pub(crate) struct Memory {
    /// The test that saw a fault: it is tried first.
    pub(crate) seen: BTreeMap<String, String>,
    /// Numbers of faults: files whose faults stay are not compiled again.
    numbers: BTreeMap<String, u32>,
    /// How many blocks around a fault are not to be used, as it does not compile there.
    skips: BTreeMap<String, usize>,
    /// Tests of programs that have not changed.
    recorded: BTreeMap<PathBuf, (SystemTime, Vec<Test>)>,
}

impl Memory {
    pub(crate) fn read(path: &Path) -> Result<Self, AnyError> {
        std::fs::read(path).map_or_else(|_| Ok(Self::default()), |bytes| Ok(serde_json::from_slice(&bytes)?))
    }

    pub(crate) fn write(&self, path: &Path) -> Result<(), AnyError> {
        Ok(std::fs::write(path, serde_json::to_vec(self)?)?)
    }

    /// The number that a fault has in the code.
    pub(crate) fn number(&mut self, fault: &Fault) -> u32 {
        let next = self.numbers.len() as u32;
        *self.numbers.entry(fault.key()).or_insert(next)
    }

    pub(crate) fn skip(&self, fault: &Fault) -> usize {
        self.skips.get(&fault.key()).copied().unwrap_or(0)
    }

    pub(crate) fn set_skip(&mut self, fault: &Fault, skip: usize) {
        self.skips.insert(fault.key(), skip);
    }

    pub(crate) fn recorded(&self, program: &Path) -> Option<&Vec<Test>> {
        let (modified, tests) = self.recorded.get(program)?;
        (changed(program)? == *modified).then_some(tests)
    }

    pub(crate) fn set_recorded(&mut self, program: &Path, tests: Vec<Test>) {
        if let Some(modified) = changed(program) {
            self.recorded.insert(program.to_owned(), (modified, tests));
        }
    }
}

fn changed(program: &Path) -> Option<SystemTime> {
    program.metadata().ok()?.modified().ok()
}
