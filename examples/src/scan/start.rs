//! The state that a run starts with: a new map, or a stored one.

use std::path::Path;

use tsdf_hash::Map;
use tsdf_hash::slam::SlamState;
use tsdf_hash::storage::MapFile;

use super::checkpoint::is_of;
use super::error::ScanError;
use super::sequence::Sequence;
use super::settings::ScanSettings;

use crate::say;

pub(super) fn open(folder: &Path, sequence: &Sequence, settings: &ScanSettings) -> Result<SlamState, ScanError> {
    let map = &settings.slam.map;
    let Some(path) = settings.resume.as_ref().or(settings.relocalise.as_ref()) else {
        return Ok(SlamState::new(match &settings.swap {
            Some(swap) => Map::with_swap(*map, swap)?,
            None => Map::new(*map)?,
        }));
    };
    let stored = |source| ScanError::Stored { path: path.display().to_string(), source };
    let file = MapFile::open(path).map_err(stored)?;
    let metadata = file.metadata().map_err(stored)?;
    let mut state = SlamState::read(file, map, settings.swap.as_deref()).map_err(stored)?;
    if settings.relocalise.is_some() && state.keyframes.is_empty() {
        return Err(ScanError::Checkpoint {
            path: path.display().to_string(),
            why: "no keyframes were stored with the map, by which a camera could be found in it: scan it again".into(),
        });
    }
    if settings.relocalise.is_some() || !is_of(&metadata, folder) {
        return Ok(state.without_trajectory());
    }
    say!("{}: goes on after the frame of {} s", path.display(), state.last_stamp);
    state.next_frame = sequence.frames.partition_point(|frame| frame.stamp <= state.last_stamp);
    Ok(state)
}
