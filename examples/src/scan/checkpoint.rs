//! What a run has done so far is kept in the file of its map: after a crash the run goes on from there.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use tsdf_hash::slam::{FrameSource, Slam};

use super::error::ScanError;

/// Name of the metadata that says which sequence a map is of.
const SEQUENCE: &str = "scan.sequence";
/// Saving takes no larger share of the time than this.
const LARGEST_SHARE: f64 = 0.1;

/// Where and how often a run is saved.
#[derive(Debug, Clone)]
pub struct CheckpointSettings {
    /// The map file.
    pub path: PathBuf,
    /// Time between two of them; longer where saving takes longer.
    pub interval: Duration,
}

/// Whether a stored map is of this sequence.
pub(super) fn is_of(metadata: &BTreeMap<String, Vec<u8>>, sequence: &Path) -> bool {
    metadata.get(SEQUENCE).is_some_and(|name| *name == metadata_of(sequence)[SEQUENCE])
}

/// What a later run over the same sequence needs to know, beside its state.
pub(super) fn metadata_of(sequence: &Path) -> BTreeMap<String, Vec<u8>> {
    let name = std::fs::canonicalize(sequence).unwrap_or_else(|_| sequence.to_path_buf()).display().to_string();
    [(SEQUENCE.to_string(), name.into_bytes())].into()
}

/// Saves a run from time to time.
pub(super) struct Checkpoints {
    settings: Option<CheckpointSettings>,
    next: Instant,
}

impl Checkpoints {
    pub(super) fn new(settings: Option<CheckpointSettings>) -> Self {
        let interval = settings.as_ref().map_or(Duration::ZERO, |s| s.interval);
        Self { settings, next: Instant::now() + interval }
    }

    /// Saves if it is time to.
    pub(super) fn save(&mut self, slam: &mut Slam<impl FrameSource>, sequence: &Path) -> Result<(), ScanError> {
        let Some(settings) = self.settings.as_ref().filter(|_| Instant::now() >= self.next) else { return Ok(()) };
        // A stored map must fit the poses that are stored with it.
        slam.reintegrate(usize::MAX)?;
        let start = Instant::now();
        let stored = |source| ScanError::Stored { path: settings.path.display().to_string(), source };
        slam.save(&settings.path, None, metadata_of(sequence)).map_err(stored)?;
        self.next = Instant::now() + settings.interval.max(start.elapsed().div_f64(LARGEST_SHARE));
        Ok(())
    }
}
