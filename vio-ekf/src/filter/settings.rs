use crate::Error;
use crate::error::{all_not_negative, invalid};

/// Settings of the filter. The defaults suit a 752x480 camera at 20 Hz and an inertial sensor at 200 Hz.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct Settings {
    /// Landmarks in the state at most, up to 200; 25 as in ROVIO (Bloesch et al. 2017).
    pub features: usize,
    /// Magnitude of gravity, m/s²; 9.81.
    pub gravity: f64,
    /// How well the camera's calibration is known.
    pub calibration: CalibrationSettings,
    /// What is assumed of landmarks.
    pub landmarks: LandmarkSettings,
    /// When measurements are believed.
    pub gates: GateSettings,
    /// Inertial samples that are kept for measurements that arrive late; ours: 256, which is 1.3 s at 200 Hz.
    pub history_samples: usize,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            features: 25,
            gravity: 9.81,
            calibration: CalibrationSettings::default(),
            landmarks: LandmarkSettings::default(),
            gates: GateSettings::default(),
            history_samples: 256,
        }
    }
}

/// Uncertainty of the calibration. A zero means known exactly: the quantity is then not estimated.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct CalibrationSettings {
    /// Standard deviation of the camera's position on the body, m per axis; ours: 0.
    pub camera_position_sigma_m: f64,
    /// Standard deviation of the camera's attitude on the body, rad per axis; ours: 0.
    pub camera_attitude_sigma: f64,
    /// Seconds to add to the camera's stamps to get the inertial sensor's time (`timeshift_cam_imu` of Kalibr); 0.
    pub time_offset_s: f64,
    /// Its standard deviation, s; ours: 0.
    pub time_offset_sigma_s: f64,
}

/// Priors and process noise of landmarks.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct LandmarkSettings {
    /// Inverse distance of a new landmark while no other is known well, 1/m; 0.5 as in ROVIO.
    pub inverse_distance: f64,
    /// Standard deviation of a new landmark's inverse distance, relative to its value; ours.
    pub inverse_distance_sigma: f64,
    /// Standard deviation of the pixel at which a landmark is first seen, where that is a measurement by itself; 1 px.
    pub pixel_sigma: f64,
    /// Process noise of the bearing, rad/√s; ours: 0, the motion model has no error but the inertial sensor's.
    pub bearing_walk: f64,
    /// Process noise of the inverse distance relative to its value, 1/√s; ours: 0.
    pub distance_walk: f64,
}

impl Default for LandmarkSettings {
    fn default() -> Self {
        Self {
            inverse_distance: 0.5,
            inverse_distance_sigma: 0.7,
            pixel_sigma: 1.0,
            bearing_walk: 0.0,
            distance_walk: 0.0,
        }
    }
}

/// When a measurement is believed, and how it is iterated.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct GateSettings {
    /// Largest squared Mahalanobis length of a landmark's residual; 9.21, 99 % of chi-square with 2 degrees of freedom.
    pub mahalanobis: f64,
    /// Iterations of one update at most; 20 as in ROVIO.
    pub iterations: usize,
    /// A landmark that fails this many times in a row is dropped; ours.
    pub misses: u32,
}

impl Default for GateSettings {
    fn default() -> Self {
        Self { mahalanobis: 9.21, iterations: 20, misses: 5 }
    }
}

impl Settings {
    /// Refuses values that no filter can work with.
    pub fn check(&self) -> Result<(), Error> {
        if !(1..=200).contains(&self.features) {
            return Err(invalid("features", self.features as f64, "must be between 1 and 200"));
        }
        if !(self.gravity > 0.0 && self.gravity < 100.0) {
            return Err(invalid("gravity", self.gravity, "must be positive, in m/s²: 9.81 on earth"));
        }
        if !(8..=100_000).contains(&self.history_samples) {
            let rule = "must be between 8 and 100000";
            return Err(invalid("history_samples", self.history_samples as f64, rule));
        }
        if self.calibration.time_offset_s.is_nan() || self.calibration.time_offset_s.abs() > 10.0 {
            return Err(invalid("time_offset_s", self.calibration.time_offset_s, "must be below 10 s"));
        }
        for (name, value) in [
            ("inverse_distance", self.landmarks.inverse_distance),
            ("inverse_distance_sigma", self.landmarks.inverse_distance_sigma),
            ("pixel_sigma", self.landmarks.pixel_sigma),
            ("mahalanobis", self.gates.mahalanobis),
        ] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(invalid(name, value, "must be positive"));
            }
        }
        if self.gates.iterations == 0 {
            return Err(invalid("iterations", 0.0, "must be at least 1"));
        }
        all_not_negative(&[
            ("camera_position_sigma_m", self.calibration.camera_position_sigma_m),
            ("camera_attitude_sigma", self.calibration.camera_attitude_sigma),
            ("time_offset_sigma_s", self.calibration.time_offset_sigma_s),
            ("bearing_walk", self.landmarks.bearing_walk),
            ("distance_walk", self.landmarks.distance_walk),
        ])
    }
}
