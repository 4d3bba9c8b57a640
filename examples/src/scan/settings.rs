//! How a sequence is mapped.

use std::path::PathBuf;

use tsdf_hash::slam::{PoseSource, SlamSettings};

use super::checkpoint::CheckpointSettings;
use super::live::LiveSettings;

/// How a sequence is mapped.
#[derive(Debug, Clone)]
pub struct ScanSettings {
    /// Localisation and map. What the sequence and the settings beside say better is taken from there: the time between frames, how often given
    /// poses are checked, whether the camera is looked for at first.
    pub slam: SlamSettings,
    /// Frames between two ray casts of the map from where the camera was, and between two looks whether depth, camera and poses agree.
    pub ray_cast_every: usize,
    /// File of the disk tier, if there is to be one.
    pub swap: Option<PathBuf>,
    /// A stored map to go on from; its settings take the place of those here, but for memory and threads. If it was stored
    /// by a run over the same sequence, its frames are not fused again.
    pub resume: Option<PathBuf>,
    /// A stored map in which the camera is looked for, and tracked; in place of `resume`.
    pub relocalise: Option<PathBuf>,
    /// Where the map is saved on the way.
    pub checkpoint: Option<CheckpointSettings>,
    /// Connected components of the mesh with fewer triangles are left out.
    pub least_triangles: usize,
    /// Who is told how it goes.
    pub live: LiveSettings,
}

impl Default for ScanSettings {
    fn default() -> Self {
        Self {
            slam: SlamSettings { poses: PoseSource::Given, ..SlamSettings::default() },
            ray_cast_every: 10,
            swap: None,
            resume: None,
            relocalise: None,
            checkpoint: None,
            least_triangles: 0,
            live: LiveSettings::default(),
        }
    }
}
