//! Whether covariances are as large as the errors.

use nalgebra::{Isometry3, Matrix3, Vector3};

use super::stats::Stats;
use crate::error::Error;
use crate::lie::so3;
use crate::trajectory::{check_poses, same_length};

/// What an estimator says about the error of one pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoseCovariance {
    /// Of the position error in the axes of the estimate's world, m².
    pub position: Matrix3<f64>,
    /// Of the attitude error as a rotation vector in body axes, rad². An estimator with a world-side attitude error `e_w`
    /// of covariance `P` gives `Rᵀ P R` here.
    pub attitude: Matrix3<f64>,
}

/// Normalised squared errors `eᵀ P⁻¹ e`: chi-square of 3 degrees of freedom, mean 3, if the covariance is consistent.
#[derive(Debug, Clone, PartialEq)]
pub struct Nees {
    /// Of the position, one per pose.
    pub position: Vec<f64>,
    /// Of the attitude, one per pose.
    pub attitude: Vec<f64>,
    /// Summary for the position.
    pub position_stats: Stats,
    /// Summary for the attitude.
    pub attitude_stats: Stats,
}

/// Normalised squared errors of paired poses, both **in the frame of the estimate**.
///
/// Align the reference into the estimate's frame first (`align(estimate, reference, ..)` and [`crate::eval::apply`]): the
/// covariances then need no rotation. Compare the mean over runs with [`crate::eval::chi2::mean_band`]. An estimate that was
/// started at the truth with a nonzero covariance scores below 1 for ever; draw its start from that covariance.
pub fn nees(
    reference: &[Isometry3<f64>],
    estimate: &[Isometry3<f64>],
    covariances: &[PoseCovariance],
) -> Result<Nees, Error> {
    same_length("reference", reference.len(), "estimate", estimate.len())?;
    same_length("estimate", estimate.len(), "covariances", covariances.len())?;
    check_poses("reference pose", reference)?;
    check_poses("estimated pose", estimate)?;
    let (mut position, mut attitude) = (Vec::new(), Vec::new());
    for (index, ((g, e), covariance)) in reference.iter().zip(estimate).zip(covariances).enumerate() {
        let offset = g.translation.vector - e.translation.vector;
        let turn = so3::log(&(e.rotation.inverse() * g.rotation));
        position.push(normalised_square(&offset, &covariance.position, "position", index)?);
        attitude.push(normalised_square(&turn, &covariance.attitude, "attitude", index)?);
    }
    let (Some(position_stats), Some(attitude_stats)) = (Stats::of(&position), Stats::of(&attitude)) else {
        return Err(Error::TooFew { what: "pose pairs to compare", got: 0, need: 1 });
    };
    Ok(Nees { position, attitude, position_stats, attitude_stats })
}

fn normalised_square(
    error: &Vector3<f64>,
    covariance: &Matrix3<f64>,
    what: &'static str,
    index: usize,
) -> Result<f64, Error> {
    let refused = Error::NotPositiveDefinite { what, index };
    // Cholesky reads one triangle only: an asymmetric matrix must be caught here.
    let tolerance = 1e-9 * covariance.amax();
    if (covariance - covariance.transpose()).iter().any(|v| v.is_nan() || v.abs() > tolerance) {
        return Err(refused);
    }
    let square = covariance.cholesky().map(|factor| error.dot(&factor.solve(error)));
    square.filter(|square| square.is_finite()).ok_or(refused)
}
