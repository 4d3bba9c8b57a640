//! Settings of the search for loops.

use crate::error::Error;
use crate::settings::NoiseModel;

/// How loops are looked for, and how far the poses are believed.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct LoopSettings {
    /// Bytes of keyframes (64 MiB).
    pub max_bytes: usize,
    /// Keyframes before the present one that are no old visit (10).
    pub recent: usize,
    /// Old keyframes that are tried for each new one because they share features (3), as many because they look alike or were taken from near by.
    pub candidates: usize,
    /// Least correlation of the small images of those that look alike (0.5).
    pub min_correlation: f64,
    /// Keyframes on either side of a candidate that make the map of its visit (3).
    pub window: usize,
    /// Edge of the voxels of that map, metres (0.02).
    pub voxel_size: f64,
    /// Error of the motion between two keyframes as a share of it (0.01), beside 2 mm and 1 mrad.
    pub odometry_error: f64,
    /// Whether a dense bundle adjustment of all keyframes follows the pose graph (true).
    pub bundle_adjust: bool,
    /// Noise of the depth camera.
    pub noise: NoiseModel,
    /// Threads used inside one call; results do not depend on it.
    pub threads: usize,
}

impl Default for LoopSettings {
    fn default() -> Self {
        Self {
            max_bytes: 64 << 20,
            recent: 10,
            candidates: 3,
            min_correlation: 0.5,
            window: 3,
            voxel_size: 0.02,
            odometry_error: 0.01,
            bundle_adjust: true,
            noise: NoiseModel::default(),
            threads: 1,
        }
    }
}

impl LoopSettings {
    pub(crate) fn check(&self) -> Result<(), Error> {
        let refuse = |name, value, requirement| Err(Error::InvalidSetting { name, value, requirement });
        if !(self.odometry_error >= 0.0 && self.odometry_error < 1.0) {
            return refuse("loops.odometry_error", self.odometry_error, "0..1");
        }
        if !(-1.0..=1.0).contains(&self.min_correlation) {
            return refuse("loops.min_correlation", self.min_correlation, "-1..=1");
        }
        Ok(())
    }
}
