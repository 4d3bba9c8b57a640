//! What a run leaves of its paints, one or several.

use std::path::Path;

use serde::Serialize;

use super::coats::Coats;
use super::coats_output::{CoatsFigures, save_coats};
use super::error::MissionError;
use super::mission_output::save;
use crate::report::Report;

/// The figures of a run, as `report.json` has them.
#[derive(Debug, Clone, Serialize)]
#[serde(untagged)]
pub enum SavedReport {
    /// Of one paint.
    Alone(Box<Report>),
    /// Of several over each other.
    Together(Box<CoatsFigures>),
}

impl SavedReport {
    /// The main figures on a few lines.
    pub fn summary(&self) -> String {
        match self {
            Self::Alone(report) => report.summary(),
            Self::Together(figures) => figures.summary(),
        }
    }
}

/// Writes pictures, meshes, recordings and reports of all that was flown into an existing folder.
pub fn save_flown(coats: &Coats, folder: &Path) -> Result<SavedReport, MissionError> {
    // A paint of its own has the folder of the run.
    match coats.missions().next() {
        Some((own, mission)) if own == folder => save(mission, folder).map(|report| SavedReport::Alone(report.into())),
        _ => save_coats(coats, folder).map(|figures| SavedReport::Together(figures.into())),
    }
}
