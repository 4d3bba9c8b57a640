//! The moving part of the state: pose, velocity and biases.

use nalgebra::{Matrix3, SMatrix, UnitQuaternion, Vector3};

use super::covariance::Covariance;
use super::error_state::{self, CORE};
use super::initial_state::{InitialSigma, InitialState};
use crate::lie::so3;

/// Covariance of the core, 15 rows; their order is that of [`Odometry::covariance`](crate::Odometry::covariance).
pub type CoreCovariance = SMatrix<f64, CORE, CORE>;

/// Pose, velocity and biases of the body, `x = (p, v, R, b_g, b_a)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CoreState {
    /// Position of the body in the world, m.
    pub position: Vector3<f64>,
    /// Velocity of the body against the world, in body axes, m/s.
    pub velocity: Vector3<f64>,
    /// Attitude `world_from_body`; its error is on the world's side.
    pub attitude: UnitQuaternion<f64>,
    /// Bias of the gyroscope, rad/s.
    pub gyro_bias: Vector3<f64>,
    /// Bias of the accelerometer, m/s².
    pub accel_bias: Vector3<f64>,
}

/// What is taken out of inertial readings: rate `diag(s) ω̃ − b_g`, specific force `A f̃ − b_a`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct ImuCorrection {
    pub(crate) gyro_bias: Vector3<f64>,
    pub(crate) accel_bias: Vector3<f64>,
    /// `None`, the identity, where it is not estimated.
    pub(crate) accel_matrix: Option<Matrix3<f64>>,
    /// `None`, one, where it is not estimated.
    pub(crate) gyro_scale: Option<Vector3<f64>>,
}

impl ImuCorrection {
    /// Whether matrix or scales are estimated.
    pub(crate) fn is_scaled(&self) -> bool {
        self.accel_matrix.is_some() || self.gyro_scale.is_some()
    }

    /// Rate of the body, rad/s.
    pub(crate) fn rate(&self, reading: &Vector3<f64>) -> Vector3<f64> {
        self.gyro_scale.map_or(*reading, |scale| scale.component_mul(reading)) - self.gyro_bias
    }

    /// Specific force on the body, m/s².
    pub(crate) fn force(&self, reading: &Vector3<f64>) -> Vector3<f64> {
        self.accel_matrix.map_or(*reading, |matrix| matrix * reading) - self.accel_bias
    }
}

impl From<&InitialState> for CoreState {
    fn from(initial: &InitialState) -> Self {
        Self {
            position: initial.world_from_body.translation.vector,
            velocity: initial.velocity_in_body,
            attitude: initial.world_from_body.rotation,
            gyro_bias: initial.gyro_bias,
            accel_bias: initial.accel_bias,
        }
    }
}

impl CoreState {
    /// `x ⊞ δ`, with the rows of [`error_state`](crate::filter::error_state).
    #[must_use]
    pub fn corrected(&self, delta: &[f64]) -> Self {
        Self {
            position: self.position + block(delta, error_state::POSITION),
            velocity: self.velocity + block(delta, error_state::VELOCITY),
            attitude: rotated(&block(delta, error_state::ATTITUDE), &self.attitude),
            gyro_bias: self.gyro_bias + block(delta, error_state::GYRO_BIAS),
            accel_bias: self.accel_bias + block(delta, error_state::ACCEL_BIAS),
        }
    }

    /// The biases, to be taken out of inertial readings.
    pub(crate) fn imu_correction(&self) -> ImuCorrection {
        ImuCorrection { gyro_bias: self.gyro_bias, accel_bias: self.accel_bias, ..ImuCorrection::default() }
    }
}

/// Enters the deviations of an initial state into the core rows of a covariance.
pub(crate) fn set_core_covariance(covariance: &mut Covariance, sigma: &InitialSigma) {
    for (row, sigma) in [
        (error_state::POSITION, [sigma.position; 3]),
        (error_state::VELOCITY, [sigma.velocity; 3]),
        (error_state::ATTITUDE, [sigma.tilt, sigma.tilt, sigma.yaw]),
        (error_state::GYRO_BIAS, [sigma.gyro_bias; 3]),
        (error_state::ACCEL_BIAS, [sigma.accel_bias; 3]),
    ] {
        covariance.set_diagonal3(row, sigma);
    }
}

/// `Exp(δ) R`.
pub(crate) fn rotated(delta: &Vector3<f64>, rotation: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::new_normalize((so3::exp(delta) * rotation).into_inner())
}

/// Three rows of an error.
pub(crate) fn block(delta: &[f64], row: usize) -> Vector3<f64> {
    Vector3::new(delta[row], delta[row + 1], delta[row + 2])
}
