//! Information matrices of poses as square roots that whiten a residual.

use nalgebra::{Isometry3, Matrix6, Translation3, Vector3, Vector6};

use crate::error::Error;
use crate::lie::so3;
use crate::trajectory::is_finite;

/// The pose that a registration asks for: the one at which it was linearised, moved by its step `(δp, δθ)`.
pub(crate) fn stepped(linearized_at: &Isometry3<f64>, step: &Vector6<f64>) -> Isometry3<f64> {
    let (shift, turn) = (step.fixed_rows::<3>(0).into_owned(), step.fixed_rows::<3>(3).into_owned());
    let position: Vector3<f64> = linearized_at.translation.vector + shift;
    Isometry3::from_parts(Translation3::from(position), so3::exp(&turn) * linearized_at.rotation)
}

/// `W` with `WᵀW` the information of a pose: it gives the residual unit covariance. `index` names the source in errors.
pub(crate) fn whitener(pose: &Isometry3<f64>, information: &Matrix6<f64>, index: usize) -> Result<Matrix6<f64>, Error> {
    if !is_finite(pose) {
        return Err(Error::NonFinite { what: "pose of source", index });
    }
    if !information.iter().all(|v| v.is_finite()) {
        return Err(Error::NonFinite { what: "information of source", index });
    }
    let refused = Error::NotPositiveDefinite { what: "pose", index };
    let tolerance = 1e-9 * information.amax();
    if (information - information.transpose()).amax() > tolerance {
        return Err(refused);
    }
    let eigen = information.symmetric_eigen();
    if eigen.eigenvalues.iter().any(|value| *value < -tolerance) {
        return Err(refused);
    }
    // A singular information is allowed: rows of zero weight say nothing.
    let mut whitener = eigen.eigenvectors.transpose();
    for (mut row, value) in whitener.row_iter_mut().zip(&eigen.eigenvalues) {
        row *= value.max(0.0).sqrt();
    }
    Ok(whitener)
}
