//! The state that a filter starts from, and how far it may be off.

use nalgebra::{Isometry3, Vector3};

use crate::error::Error;
use crate::error::all_not_negative;
use crate::stamp::Stamp;
use crate::trajectory::is_finite;

/// A state to start from, and how far it may be off.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InitialState {
    /// Time of the state.
    pub stamp: Stamp,
    /// Pose; the world's z axis points up.
    pub world_from_body: Isometry3<f64>,
    /// Velocity of the body in its own axes, m/s.
    pub velocity_in_body: Vector3<f64>,
    /// Bias of the gyroscope, rad/s.
    pub gyro_bias: Vector3<f64>,
    /// Bias of the accelerometer, m/s².
    pub accel_bias: Vector3<f64>,
    /// Standard deviations of the above.
    pub sigma: InitialSigma,
}

impl InitialState {
    /// Refuses what is not finite, negative deviations, and a time before that of the latest inertial sample.
    pub(crate) fn check(&self, latest: Stamp) -> Result<(), Error> {
        if self.stamp < latest {
            return Err(Error::Late { what: "initial state", stamp: self.stamp, now: latest });
        }
        if !is_finite(&self.world_from_body) {
            return Err(Error::NonFinite { what: "initial pose", index: 0 });
        }
        let vectors = [self.velocity_in_body, self.gyro_bias, self.accel_bias];
        if let Some(index) = vectors.iter().position(|v| v.iter().any(|v| !v.is_finite())) {
            return Err(Error::NonFinite { what: "initial velocity or bias", index });
        }
        self.sigma.check()
    }
}

/// Standard deviations of an initial state, per axis. The errors of all quantities are taken as independent.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct InitialSigma {
    /// Position, m. Position and yaw are what the filter measures from: zero unless the world existed before it.
    pub position: f64,
    /// Velocity, m/s.
    pub velocity: f64,
    /// Roll and pitch, rad.
    pub tilt: f64,
    /// Yaw, rad.
    pub yaw: f64,
    /// Gyroscope's bias, rad/s.
    pub gyro_bias: f64,
    /// Accelerometer's bias, m/s².
    pub accel_bias: f64,
}

impl Default for InitialSigma {
    /// Ours: what an initialization at rest leaves open.
    fn default() -> Self {
        Self { position: 0.0, velocity: 0.05, tilt: 0.01, yaw: 0.0, gyro_bias: 0.005, accel_bias: 0.1 }
    }
}

impl InitialSigma {
    /// Refuses deviations that are negative or not finite.
    pub fn check(&self) -> Result<(), Error> {
        all_not_negative(&[
            ("position", self.position),
            ("velocity", self.velocity),
            ("tilt", self.tilt),
            ("yaw", self.yaw),
            ("gyro_bias", self.gyro_bias),
            ("accel_bias", self.accel_bias),
        ])
    }
}
