//! When the body is taken to be stationary.

use crate::error::Error;
use crate::error::all_not_negative;

/// When the body is taken to be stationary: for the static initialization, and for zero-velocity propagation afterwards.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct StationarySettings {
    /// Least time without motion, s; 1 as in ROVIO. Images must confirm its second half. Infinite to switch all of it off.
    pub min_duration_s: f64,
    /// Largest change of a rate, averaged over a tenth of a second, since the stationary period began, rad/s; ours (ROVIO limits
    /// the rate itself, to 0.1).
    pub max_rate_change: f64,
    /// Largest change of a specific force, averaged likewise, m/s²; 0.5 as in ROVIO.
    pub max_force_change: f64,
    /// Largest parallax since images are compared, pixels, in the median of patches or points; ours. Half of it is taken as the standard deviation of
    /// undetected motion, in the pose and in the mean rate.
    pub max_parallax_px: f64,
    /// Motion is detected some time after it began. What the body was doing this long ago is certain, s; ours. A stationary period
    /// that ends is taken to have ended then, and the samples since tell the motion.
    pub delay_s: f64,
    /// Standard deviation of the velocity of a stationary body, m/s per axis; ours.
    pub velocity_sigma: f64,
    /// Uncertainty of the mean force over [`min_duration_s`](Self::min_duration_s) that no white noise explains, m/s²: vibration,
    /// and undetected motion; ours.
    pub force_sigma: f64,
    /// Largest difference between the mean force of a stationary body and gravity, m/s²; ours. More means wrong axes or units.
    pub gravity_tolerance: f64,
}

impl Default for StationarySettings {
    fn default() -> Self {
        Self {
            min_duration_s: 1.0,
            max_rate_change: 0.05,
            max_force_change: 0.5,
            max_parallax_px: 0.5,
            delay_s: 0.5,
            velocity_sigma: 0.003,
            force_sigma: 0.02,
            gravity_tolerance: 0.6,
        }
    }
}

impl StationarySettings {
    pub(super) fn check(&self) -> Result<(), Error> {
        all_not_negative(&[("stationary.delay_s", self.delay_s), ("max_parallax_px", self.max_parallax_px)])
    }
}
