//! What a program of the workspace left as `report.json`.

use std::error::Error;
use std::path::Path;

use serde_json::Value;

/// The figures of one run.
pub(super) struct ProgramReport(Value);

impl ProgramReport {
    /// That of a folder.
    pub(super) fn read(folder: &Path) -> Result<Self, Box<dyn Error>> {
        Ok(Self(serde_json::from_str(&std::fs::read_to_string(folder.join("report.json"))?)?))
    }

    /// A figure by its name.
    pub(super) fn figure(&self, name: &str) -> Result<f64, String> {
        self.0[name].as_f64().ok_or_else(|| format!("report.json lacks {name}"))
    }
}
