//! What a run leaves: the map, the mesh, the trajectory and what was measured on the way.

use std::path::Path;

use nalgebra::Isometry3;
use tsdf_hash::mesh::Mesh;
use tsdf_hash::slam::{CameraDoubt, PoseSource, Quality, SlamState, SlamStatistics};
use vio_ekf::Trajectory;

use super::checkpoint::metadata_of;
use super::error::ScanError;
use super::messages::camera;
use super::ray_cast_check::RayCastCheck;
use super::sequence::Sequence;

/// A mapped sequence.
pub struct Scan {
    /// Map, keyframes and poses.
    pub state: SlamState,
    /// The map's mesh.
    pub mesh: Mesh,
    /// Poses of the frames that were fused.
    pub trajectory: Trajectory,
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
    /// Processor time per tracked frame, ray cast of the model included, seconds.
    pub tracking_s: Vec<f64>,
    /// Processor time of the incremental mesh update after each fusion, seconds; empty for a map on a GPU.
    pub mesh_update_s: Vec<f64>,
    /// Ray casts of the map: of the finished one, or, if blocks leave active memory, on the way.
    pub ray_casts: Vec<RayCastCheck>,
    /// Processor time of the mesh from nothing, seconds.
    pub mesh_s: f64,
    /// What the pixels and poses were worth.
    pub quality: Quality,
    /// Frames whose colour image could not be read.
    pub without_colour: usize,
    /// The camera that fits the frames clearly better.
    pub camera_doubt: Option<CameraDoubt>,
    /// Units per metre with which the tracked path is as long as the recorded one, if it clearly is not.
    pub fitting_depth_scale: Option<f64>,
    /// What became of tracking and loops.
    pub statistics: SlamStatistics,
    /// Whether loops were looked for.
    pub loops: bool,
    /// Position error of the tracked poses against those recorded, rigidly aligned, root mean square, metres.
    pub ate_se3_rmse: Option<f64>,
}

impl Scan {
    /// Writes the map with its mesh, and with what a later run over the same sequence needs to know.
    ///
    /// # Errors
    /// [`ScanError::Stored`], with the file and the reason.
    pub fn save(&self, path: &Path, folder: &Path) -> Result<(), ScanError> {
        let stored = |source| ScanError::Stored { path: path.display().to_string(), source };
        self.state.save(path, Some(&self.mesh), metadata_of(folder)).map_err(stored)
    }

    /// Whether more than half of the work was done, and the result agrees with itself.
    ///
    /// # Errors
    /// [`ScanError::Unusable`], with the reason.
    pub fn verdict(&self, sequence: &Sequence) -> Result<(), ScanError> {
        let (quality, taken, frames) = (&self.metrics.quality, self.fused.len() + self.resumed, sequence.frames.len());
        let unusable = |why: String| Err(ScanError::Unusable(format!("the result is written, but not usable: {why}")));
        if 2 * taken <= frames {
            // A map that only locates the camera takes nothing in.
            let done = if quality.valid == 0 { "found in the map" } else { "fused" };
            return unusable(format!("only {taken} of {frames} frames were {done}"));
        }
        let share = quality.fused_share();
        if share < Quality::LEAST_FUSED_SHARE {
            let percent = 100.0 * share;
            return unusable(format!(
                "only {percent:.0} % of the valid pixels were fused: check --depth-scale and --noise"
            ));
        }
        if self.mesh.faces.is_empty() {
            return unusable("the map holds no surface: choose a smaller --voxel, or check --depth-scale".into());
        }
        let agreement = quality.median_agreement();
        if agreement < Quality::LEAST_AGREEMENT {
            let percent = 100.0 * agreement;
            return unusable(format!(
                "only {percent:.0} % of the depth agrees with the map: check camera (--intrinsics), --depth-scale and poses"
            ));
        }
        if let Some(doubt) = &self.metrics.camera_doubt {
            return unusable(camera(doubt));
        }
        if let Some(scale) = self.metrics.fitting_depth_scale {
            return unusable(format!(
                "the tracked path is not as long as the recorded one, with --depth-scale {scale:.0} it is"
            ));
        }
        Ok(())
    }
}
