//! Settings of the odometry, in groups.

mod calibration;
mod dynamic_initialization;
mod landmarks;
mod patches;
mod stationary;
mod stereo;
mod update;

pub use calibration::CalibrationSettings;
pub use dynamic_initialization::DynamicInitializationSettings;
pub use landmarks::LandmarkSettings;
pub use patches::PatchSettings;
pub use stationary::StationarySettings;
pub use stereo::StereoSettings;
pub use update::UpdateSettings;

use crate::error::Error;
use crate::error::invalid;
use crate::inertial::divergence::DivergenceSettings;
use crate::inertial::imu_noise_estimator::{AccelMatrixEstimation, ImuSettings};

/// Settings of the filter. The defaults suit a 752x480 camera at 20 Hz and an inertial sensor at 200 Hz.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct Settings {
    /// Magnitude of gravity, m/s²; 9.81.
    pub gravity: f64,
    /// Inertial sensor: range, adaptive noise, buffer.
    pub imu: ImuSettings,
    /// How well the camera's calibration is known.
    pub calibration: CalibrationSettings,
    /// Number, priors and process noise of landmarks.
    pub landmarks: LandmarkSettings,
    /// Extraction and photometric alignment of patches.
    pub patches: PatchSettings,
    /// Depth from a second camera.
    pub stereo: StereoSettings,
    /// Stationary detection: static initialization and zero-velocity propagation.
    pub stationary: StationarySettings,
    /// Initialization in motion.
    pub dynamic_initialization: DynamicInitializationSettings,
    /// Iteration and gate of an update.
    pub update: UpdateSettings,
    /// When the estimate is given up.
    pub divergence: DivergenceSettings,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            gravity: 9.81,
            imu: ImuSettings::default(),
            calibration: CalibrationSettings::default(),
            landmarks: LandmarkSettings::default(),
            patches: PatchSettings::default(),
            stereo: StereoSettings::default(),
            stationary: StationarySettings::default(),
            dynamic_initialization: DynamicInitializationSettings::default(),
            update: UpdateSettings::default(),
            divergence: DivergenceSettings::default(),
        }
    }
}

impl Settings {
    /// The same with a calibration that is known roughly only ([`CalibrationSettings::roughly`]), the inertial sensor's too, the scales of
    /// the gyroscope to 2 %: a filter that finds what is wrong.
    #[must_use]
    pub fn with_rough_calibration(mut self) -> Self {
        self.calibration = self.calibration.roughly();
        self.imu.gyro_scale_sigma = self.imu.gyro_scale_sigma.max(0.02);
        self.with_rough_accelerometer()
    }

    /// The same with an accelerometer whose scale is known to 3 % only.
    #[must_use]
    pub fn with_rough_accelerometer(mut self) -> Self {
        self.imu.accel_matrix = AccelMatrixEstimation::Always;
        self.imu.accel_scale_sigma = self.imu.accel_scale_sigma.max(0.03);
        self
    }

    /// Whether lenses and the scales of the gyroscope are in the state.
    pub(crate) fn estimates_lens(&self) -> bool {
        self.calibration.estimates_intrinsics() || self.imu.gyro_scale_sigma > 0.0
    }

    /// Refuses values that no filter can work with.
    pub fn check(&self) -> Result<(), Error> {
        if !(self.gravity > 0.0 && self.gravity < 100.0) {
            return Err(invalid("gravity", self.gravity, "must be positive, in m/s²: 9.81 on earth"));
        }
        self.imu.check()?;
        self.calibration.check()?;
        self.landmarks.check()?;
        self.patches.check()?;
        self.stereo.check()?;
        self.stationary.check()?;
        self.dynamic_initialization.check()?;
        self.update.check()
    }
}
