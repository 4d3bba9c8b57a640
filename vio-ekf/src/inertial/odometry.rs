//! The output of a filter: the core state now, with its covariance.

use nalgebra::{Isometry3, UnitQuaternion, Vector3};

use super::core_state::{CoreCovariance, CoreState};
use super::imu_buffer::ImuBuffer;
use super::preintegration::{ImuPreintegration, StateTransition};
use crate::stamp::Stamp;

/// An estimate of the body's motion.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Odometry {
    /// Its time, by the inertial sensor's clock.
    pub stamp: Stamp,
    /// Pose; z of the world is up.
    pub world_from_body: Isometry3<f64>,
    /// Velocity in body axes, m/s.
    pub velocity_in_body: Vector3<f64>,
    /// Angular rate in body axes, rad/s.
    pub rate_in_body: Vector3<f64>,
    /// Bias of the gyroscope, rad/s.
    pub gyro_bias: Vector3<f64>,
    /// Bias of the accelerometer, m/s².
    pub accel_bias: Vector3<f64>,
    /// Of the errors of, in this order, three rows each: position in world axes; velocity in body axes; attitude as a
    /// rotation vector in **world** axes, `R_true = Exp(δθ) R`; gyroscope's bias; accelerometer's bias.
    pub covariance: CoreCovariance,
}

impl Odometry {
    /// The pose at another time, at constant velocities.
    pub(crate) fn moved_on(&self, to: Stamp) -> Isometry3<f64> {
        let dt = to.secs_since(self.stamp);
        let Isometry3 { rotation, translation } = self.world_from_body;
        let shift = rotation * self.velocity_in_body * dt;
        let turn = UnitQuaternion::from_scaled_axis(self.rate_in_body * dt);
        Isometry3::from_parts((translation.vector + shift).into(), rotation * turn)
    }

    /// The estimate at the time of the latest sample: the state carried forward by the preintegration since its time.
    pub(crate) fn predict(
        core: &CoreState,
        covariance: &CoreCovariance,
        (buffer, prediction): (&ImuBuffer, &ImuPreintegration),
        gravity: f64,
    ) -> Self {
        let transition = prediction.transition(&core.velocity, &core.attitude, gravity);
        Self::at_end(core, &transition.propagate_covariance(covariance), (buffer, &transition))
    }

    /// The state at the end of a transition, with its covariance there.
    pub(crate) fn at_end(
        core: &CoreState,
        covariance: &CoreCovariance,
        (buffer, transition): (&ImuBuffer, &StateTransition),
    ) -> Self {
        Self {
            stamp: buffer.now(),
            world_from_body: transition.end(&core.position, &core.attitude),
            velocity_in_body: transition.velocity,
            rate_in_body: buffer.latest().gyro - core.gyro_bias,
            gyro_bias: core.gyro_bias,
            accel_bias: core.accel_bias,
            covariance: *covariance,
        }
    }
}
