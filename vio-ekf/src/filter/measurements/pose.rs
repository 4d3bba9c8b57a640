//! Poses of the body in the filter's world, measured by somebody else.

use nalgebra::{Isometry3, Matrix6, SMatrix, Vector6};

use super::measurement::{Measurement, Trial};
use crate::error::Error;
use crate::filter::state::error_state;
use crate::inertial::information::{stepped, whitener};
use crate::inertial::iterated_update::Linearization;
use crate::lie::so3;
use crate::stamp::Stamp;

/// 99.9 % of chi-square with 6 degrees of freedom.
const GATE: f64 = 22.46;

/// A pose of the body in the filter's world that somebody else has measured, and how well: of a map that is tracked, of a
/// registration, of a motion capture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BodyPose {
    /// Its time by the inertial sensor's clock.
    pub stamp: Stamp,
    /// The pose.
    pub world_from_body: Isometry3<f64>,
    /// Inverse covariance of the errors of position (m) and attitude (rad), in this order, in **world** axes; the attitude as a
    /// rotation vector with `R_true = Exp(δθ) R`. It may be singular: a direction without information is not corrected.
    pub information: Matrix6<f64>,
}

impl BodyPose {
    /// With the same standard deviation in all directions, m and rad.
    pub fn isotropic(stamp: Stamp, world_from_body: Isometry3<f64>, position_sigma: f64, attitude_sigma: f64) -> Self {
        let (p, a) = (position_sigma.powi(-2), attitude_sigma.powi(-2));
        let information = Matrix6::from_diagonal(&Vector6::new(p, p, p, a, a, a));
        Self { stamp, world_from_body, information }
    }

    /// From the result of a registration: the pose at which it was linearised, the step `(δp, δθ)` that it asks for, and its
    /// normal matrix `Σ JᵀWJ`, position before attitude, both in world axes.
    pub fn from_residual(
        stamp: Stamp,
        linearized_at: Isometry3<f64>,
        residual: &Vector6<f64>,
        information: Matrix6<f64>,
    ) -> Self {
        Self { stamp, world_from_body: stepped(&linearized_at, residual), information }
    }

    /// Refuses a pose or an information that cannot be.
    pub(crate) fn measurement(&self) -> Result<PoseMeasurementModel, Error> {
        let whitener = whitener(&self.world_from_body, &self.information, 0)?;
        Ok(PoseMeasurementModel { world_from_body: self.world_from_body, whitener })
    }
}

/// A pose with the square root of its information.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PoseMeasurementModel {
    world_from_body: Isometry3<f64>,
    whitener: Matrix6<f64>,
}

impl Measurement<6, 6> for PoseMeasurementModel {
    fn rows(&self) -> [usize; 6] {
        std::array::from_fn(|k| if k < 3 { error_state::POSITION + k } else { error_state::ATTITUDE + k - 3 })
    }

    /// The residual in units of its own deviations: position, and `Log(Z R⁻¹)`, both errors on the world's side.
    fn linearize(&self, trial: &Trial<'_, 6>) -> Option<Linearization<6, 6>> {
        let (core, measured) = (trial.core(), &self.world_from_body);
        let rotation = so3::log(&(measured.rotation * core.attitude.inverse()));
        let mut residual = Vector6::zeros();
        residual.fixed_rows_mut::<3>(0).copy_from(&(measured.translation.vector - core.position));
        residual.fixed_rows_mut::<3>(3).copy_from(&rotation);
        // Log(Z R⁻¹ Exp(−θ)) = y − J_r⁻¹(y) θ.
        let mut jacobian = SMatrix::<f64, 6, 6>::identity();
        jacobian.fixed_view_mut::<3, 3>(3, 3).copy_from(&so3::right_jacobian_inverse(&rotation));
        let whitener = &self.whitener;
        Some(Linearization { residual: whitener * residual, jacobian: whitener * jacobian, noise: Matrix6::identity() })
    }

    fn gate(&self) -> f64 {
        GATE
    }

    fn name(&self) -> &'static str {
        "pose"
    }
}
