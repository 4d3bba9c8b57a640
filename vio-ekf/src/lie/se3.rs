//! Rigid motions: `Exp`, `Log` and their Jacobians. Twists are `(ρ, φ)`: translation part first, radians last.

use nalgebra::{Isometry3, Matrix3, Matrix6, Translation3, Vector3, Vector6};

use super::{so3, stumpff};

/// Rigid motion of a constant twist over unit time: `(Exp(φ), J_l(φ) ρ)`.
pub fn exp(xi: &Vector6<f64>) -> Isometry3<f64> {
    let (rho, phi) = split(xi);
    Isometry3::from_parts(Translation3::from(so3::left_jacobian(&phi) * rho), so3::exp(&phi))
}

/// Twist of a rigid motion, with rotation part of length at most π.
pub fn log(pose: &Isometry3<f64>) -> Vector6<f64> {
    let phi = so3::log(&pose.rotation);
    let rho = so3::left_jacobian_inverse(&phi) * pose.translation.vector;
    Vector6::new(rho.x, rho.y, rho.z, phi.x, phi.y, phi.z)
}

/// `J_l` with `Exp(ξ + d) ≈ Exp(J_l(ξ) d) Exp(ξ)`: `[J Q; 0 J]` (Barfoot, State Estimation for Robotics, section 7.1.5).
pub fn left_jacobian(xi: &Vector6<f64>) -> Matrix6<f64> {
    let (_, phi) = split(xi);
    assemble(&so3::left_jacobian(&phi), &coupling(xi))
}

/// `J_r` with `Exp(ξ + d) ≈ Exp(ξ) Exp(J_r(ξ) d)`; equals `J_l(−ξ)`.
pub fn right_jacobian(xi: &Vector6<f64>) -> Matrix6<f64> {
    left_jacobian(&-xi)
}

/// Inverse of [`left_jacobian`], for a rotation part below 2π.
pub fn left_jacobian_inverse(xi: &Vector6<f64>) -> Matrix6<f64> {
    let (_, phi) = split(xi);
    let inverse = so3::left_jacobian_inverse(&phi);
    assemble(&inverse, &-(inverse * coupling(xi) * inverse))
}

/// Inverse of [`right_jacobian`], for a rotation part below 2π.
pub fn right_jacobian_inverse(xi: &Vector6<f64>) -> Matrix6<f64> {
    left_jacobian_inverse(&-xi)
}

fn split(xi: &Vector6<f64>) -> (Vector3<f64>, Vector3<f64>) {
    (xi.fixed_rows::<3>(0).into_owned(), xi.fixed_rows::<3>(3).into_owned())
}

fn assemble(diagonal: &Matrix3<f64>, upper: &Matrix3<f64>) -> Matrix6<f64> {
    let mut jacobian = Matrix6::zeros();
    jacobian.fixed_view_mut::<3, 3>(0, 0).copy_from(diagonal);
    jacobian.fixed_view_mut::<3, 3>(3, 3).copy_from(diagonal);
    jacobian.fixed_view_mut::<3, 3>(0, 3).copy_from(upper);
    jacobian
}

/// The block `Q`: how a change of rotation moves the translation.
fn coupling(xi: &Vector6<f64>) -> Matrix3<f64> {
    let (rho, phi) = split(xi);
    let (p, k) = (so3::hat(&rho), so3::hat(&phi));
    let c = stumpff(phi.norm_squared());
    let kpk = k * p * k;
    p * 0.5
        + (k * p + p * k + kpk) * c[3]
        + (k * k * p + p * k * k - kpk * 3.0) * c[4]
        + (kpk * k + k * kpk) * (0.5 * (c[4] - 3.0 * c[5]))
}
