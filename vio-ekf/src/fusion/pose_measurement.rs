//! Poses in the frame of their source.

use nalgebra::{Isometry3, Matrix6, Vector6};

use crate::error::Error;
use crate::filter::BodyPose;
use crate::inertial::information::{stepped, whitener};
use crate::stamp::Stamp;

/// A pose that somebody else has measured, and how well, in the frame of its source. In the world of the odometry it is a
/// [`BodyPose`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoseMeasurement {
    /// Which of the sources it comes from, counted from 0.
    pub source: usize,
    /// Its time by the source's clock.
    pub stamp: Stamp,
    /// Pose of the source's sensor in the source's frame.
    pub source_from_sensor: Isometry3<f64>,
    /// Inverse covariance of the errors of position (m) and attitude (rad), in this order, in the axes of the **source's
    /// frame**; the attitude as a rotation vector with `R_true = Exp(δθ) R`. It may be singular: of directions without
    /// information, such as the two along a wall that a scan was laid against, nothing is believed.
    pub information: Matrix6<f64>,
}

impl PoseMeasurement {
    /// With the same standard deviation in all directions, m and rad.
    pub fn isotropic(
        source: usize,
        stamp: Stamp,
        source_from_sensor: Isometry3<f64>,
        position_sigma: f64,
        attitude_sigma: f64,
    ) -> Self {
        let (p, a) = (position_sigma.powi(-2), attitude_sigma.powi(-2));
        let information = Matrix6::from_diagonal(&Vector6::new(p, p, p, a, a, a));
        Self { source, stamp, source_from_sensor, information }
    }

    /// From the result of a registration: the pose at which it was linearized, the step `(δp, δθ)` that it asks for, and its
    /// normal matrix `Σ JᵀWJ`, position before attitude, both in the axes of the source's frame.
    pub fn from_residual(
        source: usize,
        stamp: Stamp,
        linearized_at: Isometry3<f64>,
        residual: &Vector6<f64>,
        information: Matrix6<f64>,
    ) -> Self {
        let source_from_sensor = stepped(&linearized_at, residual);
        Self { source, stamp, source_from_sensor, information }
    }

    /// The same as a pose of the body in the world, given where the world is in the source's frame and the sensor on the body.
    pub fn of_body(&self, source_from_world: &Isometry3<f64>, body_from_sensor: &Isometry3<f64>) -> BodyPose {
        let world_from_body = source_from_world.inverse() * self.source_from_sensor * body_from_sensor.inverse();
        // With A the world's attitude, e_p = A (δp − hat(R t) δθ) and e_θ = A δθ.
        let rotation = source_from_world.rotation.to_rotation_matrix().into_inner();
        let lever = world_from_body.rotation * body_from_sensor.translation.vector;
        let mut jacobian = Matrix6::zeros();
        jacobian.fixed_view_mut::<3, 3>(0, 0).copy_from(&rotation);
        jacobian.fixed_view_mut::<3, 3>(0, 3).copy_from(&-(rotation * lever.cross_matrix()));
        jacobian.fixed_view_mut::<3, 3>(3, 3).copy_from(&rotation);
        let information = jacobian.transpose() * self.information * jacobian;
        let information = (information + information.transpose()) * 0.5;
        BodyPose { stamp: self.stamp, world_from_body, information }
    }

    /// The square root of the information; refuses a pose or an information that cannot be.
    pub(crate) fn whitener(&self) -> Result<Matrix6<f64>, Error> {
        whitener(&self.source_from_sensor, &self.information, self.source)
    }
}
