//! An inertial sensor with noise of its own for each seed.

use nalgebra::{UnitQuaternion, Vector3};

use crate::error::{Error, check_not_negative};
use crate::flight::airframe::GRAVITY;
use crate::rng::Rng;

/// Noise of an inertial sensor, as the EuRoC data sets and Kalibr name it.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct ImuSettings {
    /// White noise of the gyroscope, rad/s/sqrt(Hz). Default 1.7e-4 (ADIS16448, as are the others).
    pub gyroscope_noise_density: f64,
    /// Random walk of its bias, rad/s^2/sqrt(Hz). Default 1.9e-5.
    pub gyroscope_random_walk: f64,
    /// White noise of the accelerometer, m/s^2/sqrt(Hz). Default 2e-3.
    pub accelerometer_noise_density: f64,
    /// Random walk of its bias, m/s^3/sqrt(Hz). Default 3e-3.
    pub accelerometer_random_walk: f64,
    /// Standard deviation of the gyroscope's bias when it is switched on, rad/s. Default 1e-3.
    pub gyroscope_bias: f64,
    /// The same of the accelerometer, m/s^2. Default 0.02.
    pub accelerometer_bias: f64,
}

impl Default for ImuSettings {
    fn default() -> Self {
        Self {
            gyroscope_noise_density: 1.7e-4,
            gyroscope_random_walk: 1.9e-5,
            accelerometer_noise_density: 2e-3,
            accelerometer_random_walk: 3e-3,
            gyroscope_bias: 1e-3,
            accelerometer_bias: 0.02,
        }
    }
}

/// What an inertial sensor says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImuReading {
    /// Acceleration without gravity's, m/s^2: at rest it points up.
    pub specific_force: Vector3<f64>,
    /// Angular velocity, rad/s.
    pub angular_velocity: Vector3<f64>,
}

/// An inertial sensor at the body's centre that integrates between its readings, as the real ones do.
#[derive(Debug, Clone)]
pub struct Imu {
    settings: ImuSettings,
    rng: Rng,
    gyroscope_bias: Vector3<f64>,
    accelerometer_bias: Vector3<f64>,
    before: Option<(Vector3<f64>, UnitQuaternion<f64>)>,
}

impl Imu {
    /// A sensor that is switched on.
    ///
    /// # Errors
    /// Numbers that are negative.
    pub fn new(settings: ImuSettings, seed: u64) -> Result<Self, Error> {
        for (what, value) in [
            ("imu.gyroscope_noise_density", settings.gyroscope_noise_density),
            ("imu.gyroscope_random_walk", settings.gyroscope_random_walk),
            ("imu.accelerometer_noise_density", settings.accelerometer_noise_density),
            ("imu.accelerometer_random_walk", settings.accelerometer_random_walk),
            ("imu.gyroscope_bias", settings.gyroscope_bias),
            ("imu.accelerometer_bias", settings.accelerometer_bias),
        ] {
            check_not_negative(what, value)?;
        }
        let mut rng = Rng::new(seed, 31);
        let gyroscope_bias = rng.normal3() * settings.gyroscope_bias;
        let accelerometer_bias = rng.normal3() * settings.accelerometer_bias;
        Ok(Self { settings, rng, gyroscope_bias, accelerometer_bias, before: None })
    }

    /// The mean specific force and angular velocity since the last reading, `dt` seconds ago, of a body with a velocity (m/s, world) and an
    /// attitude (`world_from_body`).
    pub fn measure(&mut self, velocity: &Vector3<f64>, rotation: &UnitQuaternion<f64>, dt: f64) -> ImuReading {
        let now = (*velocity, *rotation);
        let (velocity, rotation) = self.before.replace(now).unwrap_or(now);
        let turn = rotation.inverse() * now.1;
        // The force is given in the middle of the interval.
        let middle = rotation * UnitQuaternion::from_scaled_axis(turn.scaled_axis() * 0.5);
        let force = middle.inverse_transform_vector(&((now.0 - velocity) / dt + Vector3::z() * GRAVITY));
        let Self { settings, rng, .. } = self;
        self.gyroscope_bias += rng.normal3() * (settings.gyroscope_random_walk * dt.sqrt());
        self.accelerometer_bias += rng.normal3() * (settings.accelerometer_random_walk * dt.sqrt());
        let mut white = |density: f64| rng.normal3() * (density / dt.sqrt());
        ImuReading {
            specific_force: force + self.accelerometer_bias + white(settings.accelerometer_noise_density),
            angular_velocity: turn.scaled_axis() / dt + self.gyroscope_bias + white(settings.gyroscope_noise_density),
        }
    }
}
