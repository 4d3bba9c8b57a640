//! What a run has done so far, kept in the file of its map: after a crash the run goes on from there.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use tsdf_hash::{KeyframeIndex, Map, MapFile};
use vio_ekf::{Trajectory, tum};

use super::error::ScanError;

/// Names of the metadata: the folder, the stamp of the last frame that is done, and the trajectory.
const KEYS: [&str; 3] = ["scan.sequence", "scan.last_stamp", "scan.trajectory"];
/// And of the keyframes.
const KEYFRAMES: &str = "scan.keyframes";
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

/// What a stored run had done.
pub(super) struct Progress {
    /// Seconds; frames up to this one need not be looked at again.
    pub(super) last_stamp: f64,
    /// The poses of those that were fused.
    pub(super) trajectory: Trajectory,
}

impl Progress {
    /// What the run that saved a map had done with this sequence; nothing if it was another one.
    pub(super) fn read(path: &Path, file: &MapFile, sequence: &Path) -> Result<Option<Self>, ScanError> {
        let fault = |why: String| ScanError::Checkpoint { path: path.display().to_string(), why };
        let metadata = file.metadata().map_err(|e| fault(e.to_string()))?;
        let text = |key: &str| metadata.get(key).map(|bytes| String::from_utf8_lossy(bytes).into_owned());
        let [Some(of), Some(done), Some(rows)] = KEYS.map(text) else { return Ok(None) };
        if of != name(sequence) {
            return Ok(None);
        }
        let last_stamp = done.parse().map_err(|_| fault(format!("its last stamp is \"{done}\"")))?;
        let trajectory = if rows.is_empty() { Trajectory::default() } else { tum::read(&rows)? };
        Ok(Some(Self { last_stamp, trajectory }))
    }
}

/// The keyframes that were stored with a map; none in maps of runs before there were any.
pub(super) fn stored_keyframes(path: &Path, file: &MapFile) -> Result<Option<KeyframeIndex>, ScanError> {
    let fault = |source| ScanError::Stored { path: path.display().to_string(), source };
    let metadata = file.metadata().map_err(fault)?;
    metadata.get(KEYFRAMES).map(|bytes| KeyframeIndex::from_bytes(bytes).map_err(fault)).transpose()
}

/// The metadata of a run.
pub(super) fn metadata(
    sequence: &Path,
    last_stamp: f64,
    trajectory: &Trajectory,
    keyframes: &KeyframeIndex,
) -> BTreeMap<String, Vec<u8>> {
    let values = [name(sequence), last_stamp.to_string(), tum::write(trajectory)];
    let mut metadata: BTreeMap<String, Vec<u8>> =
        KEYS.iter().map(|key| (*key).to_string()).zip(values.map(String::into_bytes)).collect();
    metadata.insert(KEYFRAMES.into(), keyframes.to_bytes());
    metadata
}

fn name(sequence: &Path) -> String {
    std::fs::canonicalize(sequence).unwrap_or_else(|_| sequence.to_path_buf()).display().to_string()
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

    /// Whether it is time for the next one.
    pub(super) fn are_due(&self) -> bool {
        self.settings.is_some() && Instant::now() >= self.next
    }

    /// Saves; a map on a GPU is not saved before the end.
    pub(super) fn save(
        &mut self,
        map: Option<&Map>,
        sequence: &Path,
        last_stamp: f64,
        trajectory: &Trajectory,
        keyframes: &KeyframeIndex,
    ) -> Result<(), ScanError> {
        let (Some(settings), Some(map)) = (&self.settings, map) else { return Ok(()) };
        let start = Instant::now();
        map.save(&settings.path, None, &metadata(sequence, last_stamp, trajectory, keyframes))?;
        self.next = Instant::now() + settings.interval.max(start.elapsed().div_f64(LARGEST_SHARE));
        Ok(())
    }
}
