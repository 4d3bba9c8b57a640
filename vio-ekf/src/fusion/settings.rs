//! Settings of the fusion, and of its sources.

use nalgebra::Isometry3;

use crate::error::Error;
use crate::error::{all_not_negative, invalid};
use crate::inertial::divergence::DivergenceSettings;
use crate::inertial::imu_noise_estimator::check_buffer;
use crate::trajectory::is_finite;

/// Settings of [`PoseFusion`](super::PoseFusion).
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct FusionSettings {
    /// Magnitude of gravity, m/s²; 9.81.
    pub gravity: f64,
    /// The gate: largest squared Mahalanobis distance of a pose's residual; 22.46, 99.9 % of chi-square with 6 degrees of freedom.
    pub max_mahalanobis: f64,
    /// Linearisations of one update at most; ours: 5.
    pub max_iterations: usize,
    /// When the estimate is given up; outliers in a row are counted over all sources.
    pub divergence: DivergenceSettings,
    /// Inertial samples that are kept for poses that arrive late; ours: 256, which is 1.3 s at 200 Hz.
    pub buffer_samples: usize,
    /// Poses that are kept for others that arrive later; ours: 64.
    pub buffer_poses: usize,
}

impl Default for FusionSettings {
    fn default() -> Self {
        Self {
            gravity: 9.81,
            max_mahalanobis: 22.46,
            max_iterations: 5,
            divergence: DivergenceSettings::default(),
            buffer_samples: 256,
            buffer_poses: 64,
        }
    }
}

impl FusionSettings {
    /// Refuses values that no filter can work with.
    pub fn check(&self) -> Result<(), Error> {
        if !(self.gravity > 0.0 && self.gravity < 100.0) {
            return Err(invalid("gravity", self.gravity, "must be positive, in m/s²: 9.81 on earth"));
        }
        if self.max_mahalanobis.is_nan() || self.max_mahalanobis <= 0.0 {
            return Err(invalid("max_mahalanobis", self.max_mahalanobis, "must be positive"));
        }
        if self.max_iterations == 0 {
            return Err(invalid("max_iterations", 0.0, "must be at least 1"));
        }
        check_buffer("buffer_samples", self.buffer_samples)?;
        check_buffer("buffer_poses", self.buffer_poses)
    }
}

/// A source of poses as the filter assumes it. A zero deviation means known exactly: the quantity is then not estimated.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct PoseSource {
    /// The source's frame against the world.
    pub alignment: AlignmentSettings,
    /// The extrinsics: the source's sensor on the body.
    pub extrinsics: ExtrinsicsSettings,
    /// Length in the source's frame per length in the world; 1.
    pub scale: f64,
    /// Its relative standard deviation; 0.
    pub scale_sigma: f64,
    /// Seconds to add to the source's stamps to get the inertial sensor's time: minus the delay, if the source stamps late;
    /// 0. How late a pose *arrives* does not matter.
    pub time_offset_s: f64,
    /// Its standard deviation, s; 0. The motion is extrapolated over the error: some ten milliseconds at most.
    pub time_offset_sigma_s: f64,
}

impl Default for PoseSource {
    fn default() -> Self {
        Self {
            alignment: AlignmentSettings::default(),
            extrinsics: ExtrinsicsSettings::default(),
            scale: 1.0,
            scale_sigma: 0.0,
            time_offset_s: 0.0,
            time_offset_sigma_s: 0.0,
        }
    }
}

/// Alignment of the source's frame with the world: how well it is known, and how it drifts.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct AlignmentSettings {
    /// Pose of the world in the source's frame; identity.
    pub source_from_world: Isometry3<f64>,
    /// Standard deviation of its position, m per axis; 0.
    pub position_sigma: f64,
    /// Of the angles that tilt the world's vertical, rad; 0, right for a source that knows gravity.
    pub tilt_sigma: f64,
    /// Of the angle about the world's vertical, rad; 0.
    pub yaw_sigma: f64,
    /// Drift of the source: random walk of the position, m/√s per axis; 0.
    pub position_walk: f64,
    /// Random walk of the tilt, rad/√s; 0.
    pub tilt_walk: f64,
    /// Random walk of the yaw, rad/√s, about the place where the body is; 0.
    pub yaw_walk: f64,
}

impl Default for AlignmentSettings {
    fn default() -> Self {
        Self {
            source_from_world: Isometry3::identity(),
            position_sigma: 0.0,
            tilt_sigma: 0.0,
            yaw_sigma: 0.0,
            position_walk: 0.0,
            tilt_walk: 0.0,
            yaw_walk: 0.0,
        }
    }
}

/// The extrinsics of a source: where its sensor is on the body.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct ExtrinsicsSettings {
    /// Pose of the sensor on the body; identity.
    pub body_from_sensor: Isometry3<f64>,
    /// Standard deviation of its position, m per axis; 0.
    pub position_sigma: f64,
    /// Standard deviation of its attitude, rad per axis; 0.
    pub attitude_sigma: f64,
}

impl Default for ExtrinsicsSettings {
    fn default() -> Self {
        Self { body_from_sensor: Isometry3::identity(), position_sigma: 0.0, attitude_sigma: 0.0 }
    }
}

impl PoseSource {
    /// Refuses values that no source can have.
    pub fn check(&self) -> Result<(), Error> {
        if !is_finite(&self.alignment.source_from_world) {
            return Err(Error::NonFinite { what: "source_from_world", index: 0 });
        }
        if !is_finite(&self.extrinsics.body_from_sensor) {
            return Err(Error::NonFinite { what: "body_from_sensor", index: 0 });
        }
        if !(self.scale > 0.0 && self.scale.is_finite()) {
            return Err(invalid("scale", self.scale, "must be positive"));
        }
        if self.time_offset_s.is_nan() || self.time_offset_s.abs() > 10.0 {
            return Err(invalid("time_offset_s", self.time_offset_s, "must be below 10 s"));
        }
        all_not_negative(&[
            ("alignment.position_sigma", self.alignment.position_sigma),
            ("alignment.tilt_sigma", self.alignment.tilt_sigma),
            ("alignment.yaw_sigma", self.alignment.yaw_sigma),
            ("alignment.position_walk", self.alignment.position_walk),
            ("alignment.tilt_walk", self.alignment.tilt_walk),
            ("alignment.yaw_walk", self.alignment.yaw_walk),
            ("extrinsics.position_sigma", self.extrinsics.position_sigma),
            ("extrinsics.attitude_sigma", self.extrinsics.attitude_sigma),
            ("scale_sigma", self.scale_sigma),
            ("time_offset_sigma_s", self.time_offset_sigma_s),
        ])
    }
}
