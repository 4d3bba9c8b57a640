//! What a run leaves: the map, the mesh, the trajectory and what was measured on the way.

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::Isometry3;
use tsdf_hash::{KeyframeIndex, Map, Mesh};
use vio_ekf::Trajectory;

use super::checkpoint::metadata;
use super::correction::LoopMetrics;
use super::error::ScanError;
use super::pose_source::{PoseSource, TrackingMetrics};
use super::quality::Quality;
use super::ray_cast_check::RayCastCheck;
use super::sequence::Sequence;

/// A mapped sequence.
pub struct Scan {
    /// The map.
    pub map: Map,
    /// Its mesh.
    pub mesh: Mesh,
    /// Poses of the frames that were fused.
    pub trajectory: Trajectory,
    /// Keyframes, to find a camera in the map by.
    pub keyframes: KeyframeIndex,
    /// Indices of the frames that were fused (or only found) in this run, and their poses.
    pub fused: Vec<(usize, Isometry3<f64>)>,
    /// Frames that could not be fused, with the reason.
    pub skipped: Vec<(usize, String)>,
    /// Frames that a run before this one had done.
    pub resumed: usize,
    /// Which poses were believed.
    pub poses: PoseSource,
    /// What kept the map.
    pub device: String,
    /// What was measured on the way.
    pub metrics: ScanMetrics,
}

/// What was measured while the map grew.
#[derive(Debug, Clone, Default)]
pub struct ScanMetrics {
    /// Processor time of each fusion, seconds.
    pub integrate_s: Vec<f64>,
    /// Processor time of the incremental mesh update after each fusion, seconds; empty for a map on a GPU.
    pub mesh_update_s: Vec<f64>,
    /// Ray casts of the map: of the finished one, or, if blocks leave active memory, on the way.
    pub ray_casts: Vec<RayCastCheck>,
    /// Processor time of the mesh from nothing, seconds.
    pub mesh_s: f64,
    /// Largest number of bytes in active memory.
    pub active_bytes_peak: usize,
    /// Largest number of bytes in the host tier.
    pub host_bytes_peak: usize,
    /// What the pixels and poses were worth.
    pub quality: Quality,
    /// What became of tracking, if the poses were tracked.
    pub tracking: Option<TrackingMetrics>,
    /// What became of the loops, if they were looked for.
    pub loops: Option<LoopMetrics>,
    /// Position error of the tracked poses against those recorded, rigidly aligned, root mean square, metres.
    pub ate_se3_rmse: Option<f64>,
}

impl Scan {
    /// What a later run over the same sequence needs to know, for [`Map::save`].
    pub fn metadata(&self, folder: &Path, sequence: &Sequence) -> BTreeMap<String, Vec<u8>> {
        let last = sequence.frames.last().map_or(f64::NEG_INFINITY, |frame| frame.stamp);
        metadata(folder, last, &self.trajectory, &self.keyframes)
    }

    /// Whether at least half of the work was done.
    ///
    /// # Errors
    /// [`ScanError::Unusable`], with the reason.
    pub fn verdict(&self, sequence: &Sequence) -> Result<(), ScanError> {
        self.metrics.quality.verdict(self.fused.len() + self.resumed, sequence.frames.len())
    }
}
