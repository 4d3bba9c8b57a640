//! Settings of the dense bundle adjustment.

use crate::error::Error;
use crate::settings::NoiseModel;

/// How [`bundle_adjust`](crate::loop_closure::bundle_adjust) works.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct BundleAdjustmentSettings {
    /// Most Gauss-Newton steps (6).
    pub max_iterations: usize,
    /// Done when no keyframe moves by more, metres and radians (2e-5).
    pub least_step: f64,
    /// Edge of the voxels of the map whose mesh gives the points of the surface and their normals, metres (0.03).
    pub voxel_size: f64,
    /// Most points of the surface (60,000).
    pub max_points: usize,
    /// What a keyframe measures farther than this from a point, beside three standard deviations, is another surface, metres (0.02).
    pub max_distance: f64,
    /// Whether intensities take part, where keyframes have them.
    pub photometric: bool,
    /// Noise of the depth camera: the relative weight of near and far points. Its scale is estimated.
    pub noise: NoiseModel,
    /// Threads used inside one call; results do not depend on it.
    pub threads: usize,
}

impl Default for BundleAdjustmentSettings {
    fn default() -> Self {
        Self {
            max_iterations: 6,
            least_step: 2e-5,
            voxel_size: 0.03,
            max_points: 60_000,
            max_distance: 0.02,
            photometric: true,
            noise: NoiseModel::default(),
            threads: 1,
        }
    }
}

impl BundleAdjustmentSettings {
    pub(crate) fn check(&self) -> Result<(), Error> {
        let positive = |name, value: f64| {
            // A comparison that a NaN fails.
            if value > 0.0 && value <= 1e3 {
                Ok(())
            } else {
                Err(Error::InvalidSetting { name, value, requirement: "above 0, at most 1000" })
            }
        };
        positive("bundle_adjustment.least_step", self.least_step)?;
        positive("bundle_adjustment.max_distance", self.max_distance)
    }
}
