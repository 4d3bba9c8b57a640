//! The inertial sensor on the robot.

use nalgebra::{Isometry3, Vector3};

use crate::error::{Error, check_not_negative};
use crate::rng::Rng;

/// Standard gravity, m/s^2.
const GRAVITY: f64 = 9.80665;
/// Half of the time over which a reading averages, s.
const HALF: f64 = 5e-3;

/// Noise of the sensor: a MEMS sensor after calibration.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct InertialSensorSettings {
    /// White noise of each component of the specific force, m/s^2 (default 0.05).
    pub force_sigma: f64,
    /// Standard deviation of its constant bias, m/s^2 (default 0.02).
    pub force_bias: f64,
    /// White noise of each component of the angular velocity, rad/s (default 0.005).
    pub rate_sigma: f64,
    /// Standard deviation of its constant bias, rad/s (default 0.002).
    pub rate_bias: f64,
}

impl Default for InertialSensorSettings {
    fn default() -> Self {
        Self { force_sigma: 0.05, force_bias: 0.02, rate_sigma: 5e-3, rate_bias: 2e-3 }
    }
}

/// What the sensor says, in the robot's frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InertialReading {
    /// Acceleration without gravity's, m/s^2: at rest it points up.
    pub specific_force: Vector3<f64>,
    /// Angular velocity, rad/s.
    pub angular_velocity: Vector3<f64>,
}

/// A sensor at the robot's origin.
#[derive(Debug, Clone)]
pub struct InertialSensor {
    settings: InertialSensorSettings,
    noise: Rng,
    force_bias: Vector3<f64>,
    rate_bias: Vector3<f64>,
}

impl InertialSensor {
    /// With noise and biases of its own for each seed.
    ///
    /// # Errors
    /// Numbers that are negative.
    pub fn new(settings: InertialSensorSettings, seed: u64) -> Result<Self, Error> {
        check_not_negative("inertial_sensor.force_sigma", settings.force_sigma)?;
        check_not_negative("inertial_sensor.force_bias", settings.force_bias)?;
        check_not_negative("inertial_sensor.rate_sigma", settings.rate_sigma)?;
        check_not_negative("inertial_sensor.rate_bias", settings.rate_bias)?;
        let mut noise = Rng::new(seed, 25);
        let mut normal = |sigma: f64| Vector3::from_fn(|_, _| noise.normal()) * sigma;
        let (force_bias, rate_bias) = (normal(settings.force_bias), normal(settings.rate_bias));
        Ok(Self { settings, noise, force_bias, rate_bias })
    }

    /// The reading at a time (s) of a motion.
    pub fn measure(&mut self, motion: &dyn Fn(f64) -> Isometry3<f64>, time: f64) -> InertialReading {
        let [before, now, after] = [time - HALF, time, time + HALF].map(motion);
        let place = |pose: &Isometry3<f64>| pose.translation.vector;
        let acceleration = (place(&after) - 2.0 * place(&now) + place(&before)) / (HALF * HALF);
        let turned = (before.rotation.inverse() * after.rotation).scaled_axis() / (2.0 * HALF);
        let Self { settings, noise, force_bias, rate_bias } = self;
        let mut white = |sigma: f64| Vector3::from_fn(|_, _| noise.normal()) * sigma;
        let up = Vector3::z() * GRAVITY;
        InertialReading {
            specific_force: now.rotation.inverse() * (acceleration + up) + *force_bias + white(settings.force_sigma),
            angular_velocity: turned + *rate_bias + white(settings.rate_sigma),
        }
    }
}
