//! How a sequence is mapped.

use std::path::PathBuf;

use super::checkpoint::CheckpointSettings;
use super::live::LiveSettings;
use super::map_store::Device;
use super::pose_source::PoseSource;

/// How a sequence is mapped.
#[derive(Debug, Clone)]
pub struct ScanSettings {
    /// The map.
    pub map: tsdf_hash::Settings,
    /// Which poses are believed.
    pub poses: PoseSource,
    /// Frames between two ray casts of the map from where the camera was, and between two looks whether depth, camera and poses agree.
    pub ray_cast_every: usize,
    /// Where the map is kept.
    pub device: Device,
    /// File of the disk tier, if there is to be one.
    pub swap: Option<PathBuf>,
    /// A stored map to go on from; its settings take the place of those here, but for memory and threads. If it was stored
    /// by a run over the same sequence, its frames are not fused again.
    pub resume: Option<PathBuf>,
    /// A stored map in which the camera is looked for, and tracked; in place of `resume`.
    pub relocalise: Option<PathBuf>,
    /// Whether frames are fused; without, a stored map stays as it is.
    pub fuse: bool,
    /// Whether loops are looked for, and the map follows the corrected poses.
    pub loops: bool,
    /// Where the map is saved on the way.
    pub checkpoint: Option<CheckpointSettings>,
    /// Who is told how it goes.
    pub live: LiveSettings,
}

impl Default for ScanSettings {
    fn default() -> Self {
        let map = tsdf_hash::Settings::default();
        Self {
            map,
            poses: PoseSource::Given,
            ray_cast_every: 10,
            device: Device::Cpu,
            swap: None,
            resume: None,
            relocalise: None,
            fuse: true,
            loops: false,
            checkpoint: None,
            live: LiveSettings::default(),
        }
    }
}
