use nalgebra::{Isometry3, Matrix6, Translation3, Vector3, Vector6};

use crate::trajectory::is_finite;
use crate::{Error, Stamp, so3};

/// A pose that somebody else has measured, and how well.
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

    /// From the result of a registration: the pose at which it was linearised, the step `(δp, δθ)` that it asks for, and its
    /// normal matrix `Σ JᵀWJ`, position before attitude, both in the axes of the source's frame.
    pub fn from_residual(
        source: usize,
        stamp: Stamp,
        linearised_at: Isometry3<f64>,
        residual: &Vector6<f64>,
        information: Matrix6<f64>,
    ) -> Self {
        let (shift, turn) = (residual.fixed_rows::<3>(0).into_owned(), residual.fixed_rows::<3>(3).into_owned());
        let position: Vector3<f64> = linearised_at.translation.vector + shift;
        let source_from_sensor =
            Isometry3::from_parts(Translation3::from(position), so3::exp(&turn) * linearised_at.rotation);
        Self { source, stamp, source_from_sensor, information }
    }

    /// The same knowledge as a pose of the body in the world, given where the world is in the source's frame and the sensor on
    /// the body.
    #[must_use]
    pub fn of_body(&self, source_from_world: &Isometry3<f64>, body_from_sensor: &Isometry3<f64>) -> Self {
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
        Self { source_from_sensor: world_from_body, information, ..*self }
    }

    /// `W` with `WᵀW` the information: it turns the residual into one of unit covariance.
    pub(crate) fn whitener(&self) -> Result<Matrix6<f64>, Error> {
        if !is_finite(&self.source_from_sensor) {
            return Err(Error::NonFinite { what: "pose of source", index: self.source });
        }
        if !self.information.iter().all(|v| v.is_finite()) {
            return Err(Error::NonFinite { what: "information of source", index: self.source });
        }
        let refused = Error::NotPositiveDefinite { what: "pose", index: self.source };
        let tolerance = 1e-9 * self.information.amax();
        if (self.information - self.information.transpose()).amax() > tolerance {
            return Err(refused);
        }
        let eigen = self.information.symmetric_eigen();
        if eigen.eigenvalues.iter().any(|value| *value < -tolerance) {
            return Err(refused);
        }
        let mut whitener = eigen.eigenvectors.transpose();
        for (mut row, value) in whitener.row_iter_mut().zip(&eigen.eigenvalues) {
            row *= value.max(0.0).sqrt();
        }
        Ok(whitener)
    }
}
