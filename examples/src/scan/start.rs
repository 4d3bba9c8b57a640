//! The map that a run starts with: a new one, or a stored one.

use std::path::Path;

use tsdf_hash::{KeyframeIndex, Map, MapFile};

use super::checkpoint::{Progress, stored_keyframes};
use super::error::ScanError;
use super::settings::ScanSettings;

/// What a run starts with.
pub(super) struct Start {
    pub(super) map: Map,
    /// What an earlier run over the same sequence had done.
    pub(super) progress: Option<Progress>,
    pub(super) keyframes: KeyframeIndex,
}

impl Start {
    pub(super) fn open(folder: &Path, settings: &ScanSettings) -> Result<Self, ScanError> {
        let Some(path) = settings.resume.as_ref().or(settings.relocalise.as_ref()) else {
            let map = match &settings.swap {
                Some(swap) => Map::with_swap(settings.map, swap)?,
                None => Map::new(settings.map)?,
            };
            return Ok(Self { map, progress: None, keyframes: KeyframeIndex::new() });
        };
        let stored = |source| ScanError::Stored { path: path.display().to_string(), source };
        let file = MapFile::open(path).map_err(stored)?;
        let keyframes = stored_keyframes(path, &file)?;
        let mut progress = None;
        if settings.relocalise.is_some() {
            if keyframes.as_ref().is_none_or(KeyframeIndex::is_empty) {
                return Err(ScanError::Checkpoint {
                    path: path.display().to_string(),
                    why: "no keyframes were stored with the map, by which a camera could be found in it: scan it again"
                        .into(),
                });
            }
        } else {
            progress = Progress::read(path, &file, folder)?;
        }
        if let Some(progress) = &progress {
            eprintln!("{}: goes on after the frame of {} s", path.display(), progress.last_stamp);
        }
        let tsdf_hash::Settings { max_bytes, threads, memory, .. } = settings.map;
        let continued = tsdf_hash::Settings { max_bytes, threads, memory, ..*file.settings() };
        let map = file.into_map(continued, settings.swap.as_deref()).map_err(stored)?;
        Ok(Self { map, progress, keyframes: keyframes.unwrap_or_default() })
    }
}
