//! When an initialization in motion is accepted.

use crate::error::Error;
use crate::error::{all_not_negative, all_positive};

/// When an initialization in motion is accepted.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct DynamicInitializationSettings {
    /// Whether it is tried at all; yes.
    pub enabled: bool,
    /// Least length of the window, s; ours.
    pub min_window_s: f64,
    /// Largest length of the window while the scale is not known, s; ours.
    pub max_window_s: f64,
    /// Standard deviation of a tracked point, pixels; ours. The residuals of the points themselves may raise it.
    pub pixel_sigma: f64,
    /// Largest root mean square reprojection error, pixels; ours.
    pub max_reprojection_error: f64,
    /// Largest relative standard deviation of the scale; ours.
    pub max_scale_sigma: f64,
    /// Standard deviation of the gyroscope's bias before anything is known, rad/s; ours.
    pub gyro_bias_sigma: f64,
    /// The same of the accelerometer's, m/s²; ours.
    pub accel_bias_sigma: f64,
    /// Time after the initialization in which outliers make it try again instead of giving up, s; ours.
    pub probation_s: f64,
}

impl Default for DynamicInitializationSettings {
    fn default() -> Self {
        Self {
            enabled: true,
            min_window_s: 0.5,
            max_window_s: 3.0,
            pixel_sigma: 0.3,
            max_reprojection_error: 1.0,
            max_scale_sigma: 0.05,
            gyro_bias_sigma: 0.05,
            accel_bias_sigma: 0.1,
            probation_s: 3.0,
        }
    }
}

impl DynamicInitializationSettings {
    pub(super) fn check(&self) -> Result<(), Error> {
        all_positive(&[
            ("dynamic_initialization.min_window_s", self.min_window_s),
            ("dynamic_initialization.max_window_s", self.max_window_s),
            ("dynamic_initialization.pixel_sigma", self.pixel_sigma),
            ("dynamic_initialization.max_reprojection_error", self.max_reprojection_error),
            ("dynamic_initialization.max_scale_sigma", self.max_scale_sigma),
            ("dynamic_initialization.gyro_bias_sigma", self.gyro_bias_sigma),
            ("dynamic_initialization.accel_bias_sigma", self.accel_bias_sigma),
        ])?;
        all_not_negative(&[("dynamic_initialization.probation_s", self.probation_s)])
    }
}
