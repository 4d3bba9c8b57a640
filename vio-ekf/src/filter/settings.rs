use super::moving::MovingSettings;
use super::pair::PairSettings;
use super::rest::RestSettings;
use super::trust::SensorSettings;
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
    /// How the inertial sensor may be worse than its data sheet.
    pub sensor: SensorSettings,
    /// How well the camera's calibration is known.
    pub calibration: CalibrationSettings,
    /// What is assumed of landmarks.
    pub landmarks: LandmarkSettings,
    /// How images are read.
    pub patches: PatchSettings,
    /// How the images of a pair of cameras are compared.
    pub pair: PairSettings,
    /// When the body is taken to be at rest.
    pub rest: RestSettings,
    /// When a start in motion is believed.
    pub moving: MovingSettings,
    /// When the estimate is given up.
    pub limits: LimitSettings,
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
            sensor: SensorSettings::default(),
            calibration: CalibrationSettings::default(),
            landmarks: LandmarkSettings::default(),
            patches: PatchSettings::default(),
            pair: PairSettings::default(),
            rest: RestSettings::default(),
            moving: MovingSettings::default(),
            limits: LimitSettings::default(),
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
    /// Standard deviation of the stamp of each image, s; ours: 0. With it every image has an offset of its own, found with the
    /// landmarks that it sees, and the mean offset is taken as known.
    pub stamp_jitter_s: f64,
}

/// Priors and process noise of landmarks.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct LandmarkSettings {
    /// Inverse distance that is expected of landmarks at the start, 1/m; ours, ROVIO has 0.5. From then on it is estimated.
    pub inverse_distance: f64,
    /// Standard deviation of what all first landmarks have in common: the scene is larger or smaller than expected. Relative to
    /// [`inverse_distance`](Self::inverse_distance); ours. Where the distance is known roughly, say 0.1.
    pub common_sigma: f64,
    /// Random walk of what is expected, relative to it, 1/√s: the camera comes to see another scene; ours.
    pub common_walk: f64,
    /// Standard deviation of a landmark's inverse distance from what is expected, relative to that; ours.
    pub inverse_distance_sigma: f64,
    /// Standard deviation of the pixel at which a landmark is first seen, where that is a measurement by itself; 1 px.
    pub pixel_sigma: f64,
}

impl Default for LandmarkSettings {
    fn default() -> Self {
        Self {
            inverse_distance: 0.3,
            common_sigma: 0.4,
            common_walk: 0.3,
            inverse_distance_sigma: 0.7,
            pixel_sigma: 1.0,
        }
    }
}

/// How images are read.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct PatchSettings {
    /// The finest of the two pyramid levels that patches are made of. ROVIO uses 1; ours is 0: linear interpolation costs
    /// a fixed part of a level's pixel.
    pub first_level: usize,
    /// Least standard deviation of a pixel's difference, grey levels; what a comparison leaves unexplained may raise it.
    pub grey_sigma: f64,
    /// Standard deviation of a patch's position that no pixel noise explains, pixels: interpolation, slanted surfaces; ours.
    pub pixel_sigma: f64,
    /// Random walk of the point that a patch stands for, pixels/√s: seen from elsewhere, a slanted or rough surface no longer
    /// agrees with the patch, in a way that lasts; ours.
    pub drift: f64,
    /// Largest share of a patch's contrast (in squares) that may be left unexplained; ours.
    pub unexplained: f64,
    /// Threshold of the corner test, grey levels; 5 as in ROVIO.
    pub corner_threshold: u8,
    /// Least smaller eigenvalue of a new patch's information, (grey level/pixel)² per pixel; ours.
    pub score: f64,
    /// New landmarks are sought when fewer than this share of the slots is in use; 0.8 as in ROVIO.
    pub refill: f64,
    /// Least distance of a new landmark from all others, pixels; ours.
    pub nearest: f64,
    /// Distance beyond which other landmarks no longer make a place less attractive, pixels; 100 as in ROVIO.
    pub farthest: f64,
    /// A patch is taken anew when it is seen larger or smaller by this factor in area; ours.
    pub rescale: f64,
}

impl Default for PatchSettings {
    fn default() -> Self {
        Self {
            first_level: 0,
            grey_sigma: 2.0,
            pixel_sigma: 0.1,
            drift: 0.15,
            unexplained: 0.4,
            corner_threshold: 5,
            score: 0.5,
            refill: 0.8,
            nearest: 20.0,
            farthest: 100.0,
            rescale: 2.0,
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

/// The divergence test: the estimate is given up when any of these is exceeded. All ours.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct LimitSettings {
    /// Speed, m/s.
    pub speed: f64,
    /// Standard deviation of the velocity along its worst axis, m/s: dead reckoning has lasted too long.
    pub velocity_sigma: f64,
    /// Bias of the gyroscope, rad/s.
    pub gyro_bias: f64,
    /// Bias of the accelerometer, m/s².
    pub accel_bias: f64,
    /// Images in a row in which most of at least five landmarks contradict the prediction.
    pub contradictions: u32,
}

impl Default for LimitSettings {
    fn default() -> Self {
        Self { speed: 30.0, velocity_sigma: 1.0, gyro_bias: 0.5, accel_bias: 3.0, contradictions: 10 }
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
            ("grey_sigma", self.patches.grey_sigma),
            ("unexplained", self.patches.unexplained),
            ("farthest", self.patches.farthest),
            ("gyro_range", self.sensor.gyro_range),
            ("accel_range", self.sensor.accel_range),
            ("roughness", self.sensor.roughness),
            ("moving.least_s", self.moving.least_s),
            ("moving.outlook_s", self.moving.outlook_s),
            ("moving.pixel_sigma", self.moving.pixel_sigma),
            ("moving.misfit", self.moving.misfit),
            ("moving.scale_sigma", self.moving.scale_sigma),
            ("moving.gyro_bias_sigma", self.moving.gyro_bias_sigma),
            ("moving.accel_bias_sigma", self.moving.accel_bias_sigma),
        ] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(invalid(name, value, "must be positive"));
            }
        }
        if self.patches.first_level > 4 {
            return Err(invalid("first_level", self.patches.first_level as f64, "must be at most 4"));
        }
        if self.patches.rescale.is_nan() || self.patches.rescale <= 1.0 {
            return Err(invalid("rescale", self.patches.rescale, "must be above 1"));
        }
        if self.gates.iterations == 0 {
            return Err(invalid("iterations", 0.0, "must be at least 1"));
        }
        self.pair.check()?;
        all_not_negative(&[
            ("camera_position_sigma_m", self.calibration.camera_position_sigma_m),
            ("camera_attitude_sigma", self.calibration.camera_attitude_sigma),
            ("time_offset_sigma_s", self.calibration.time_offset_sigma_s),
            ("stamp_jitter_s", self.calibration.stamp_jitter_s),
            ("moving.doubt_s", self.moving.doubt_s),
            ("rest.delay_s", self.rest.delay_s),
            ("rest.pixels", self.rest.pixels),
            ("common_sigma", self.landmarks.common_sigma),
            ("common_walk", self.landmarks.common_walk),
            ("pixel_sigma", self.patches.pixel_sigma),
            ("drift", self.patches.drift),
            ("score", self.patches.score),
            ("refill", self.patches.refill),
            ("nearest", self.patches.nearest),
        ])
    }
}
