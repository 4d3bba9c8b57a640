//! Depth from a second camera.

use crate::error::Error;
use crate::error::invalid;

/// Depth from a second camera by epipolar search. All ours.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct StereoSettings {
    /// Standard deviation of a patch's position in the second image that no pixel noise explains, pixels: interpolation,
    /// slanted surfaces, and what is wrong with the calibration of one camera against the other.
    pub pixel_sigma: f64,
    /// Least distance at which a new landmark is searched for, m.
    pub min_distance_m: f64,
    /// A match is unique if everywhere else along the epipolar line the residual is this many times as large.
    pub uniqueness_ratio: f64,
}

impl Default for StereoSettings {
    fn default() -> Self {
        Self { pixel_sigma: 0.3, min_distance_m: 0.5, uniqueness_ratio: 2.0 }
    }
}

impl StereoSettings {
    pub(super) fn check(&self) -> Result<(), Error> {
        if !(self.pixel_sigma > 0.0 && self.pixel_sigma.is_finite()) {
            return Err(invalid("stereo.pixel_sigma", self.pixel_sigma, "must be positive and finite, in pixels"));
        }
        if !(self.min_distance_m > 0.0 && self.min_distance_m.is_finite()) {
            return Err(invalid("min_distance_m", self.min_distance_m, "must be positive and finite, in metres"));
        }
        if !(self.uniqueness_ratio >= 1.0 && self.uniqueness_ratio.is_finite()) {
            return Err(invalid("uniqueness_ratio", self.uniqueness_ratio, "must be at least 1"));
        }
        Ok(())
    }
}
