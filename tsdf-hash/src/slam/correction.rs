//! Where the frames of a run are after a loop was closed.

use nalgebra::Isometry3;

use crate::mesh::deformation::EmbeddedDeformation;

/// Frames that move by less are not fused anew: a share of a voxel, and radians.
const LEAST_MOTION: [f64; 2] = [0.25, 8.7e-4];

/// A correction of the trajectory.
#[derive(Debug, Clone)]
pub struct Correction {
    /// The new pose of each fused frame of the run.
    pub(crate) frames: Vec<Isometry3<f64>>,
    /// What the present moves by.
    pub present: Isometry3<f64>,
    /// What a mesh of the map before does at once; the map follows frame by frame.
    pub deformation: EmbeddedDeformation,
}

impl Correction {
    /// The new pose of a fused frame, if it differs by enough to fuse it anew.
    pub(crate) fn moved(&self, frame: usize, pose: &Isometry3<f64>, voxel_size: f64) -> Option<Isometry3<f64>> {
        let moved = *self.frames.get(frame)?;
        let apart = pose.inverse() * moved;
        let far =
            apart.translation.vector.norm() > LEAST_MOTION[0] * voxel_size || apart.rotation.angle() > LEAST_MOTION[1];
        far.then_some(moved)
    }
}
