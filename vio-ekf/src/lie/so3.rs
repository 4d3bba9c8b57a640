//! Rotations: `Exp`, `Log` and their Jacobians (Hamilton quaternions, rotation vectors in radians).

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

use super::stumpff;

/// The matrix of the cross product, `hat(a) b = a × b`.
pub fn hat(v: &Vector3<f64>) -> Matrix3<f64> {
    v.cross_matrix()
}

/// Rotation by the angle `|v|` about the axis `v`.
pub fn exp(v: &Vector3<f64>) -> UnitQuaternion<f64> {
    let c = stumpff(v.norm_squared() / 4.0);
    UnitQuaternion::new_unchecked(Quaternion::from_parts(c[0], v * (c[1] / 2.0)))
}

/// Rotation vector of length at most π; at exactly half a turn one of its two values.
pub fn log(q: &UnitQuaternion<f64>) -> Vector3<f64> {
    // q and -q are one rotation: the one with w ≥ 0 goes the short way.
    let (w, v) = if q.w < 0.0 { (-q.w, -q.imag()) } else { (q.w, q.imag()) };
    let sine = v.norm();
    // Below this angle/sine is 2 to the last bit, and the quotient would be 0/0 at zero.
    if sine < 1e-9 { v * 2.0 } else { v * (2.0 * sine.atan2(w) / sine) }
}

/// Rotation angle between two orientations, in `[0, π]`.
pub fn angle_between(a: &UnitQuaternion<f64>, b: &UnitQuaternion<f64>) -> f64 {
    log(&(a.inverse() * b)).norm()
}

/// `J_l` with `Exp(v + d) ≈ Exp(J_l(v) d) Exp(v)`.
pub fn left_jacobian(v: &Vector3<f64>) -> Matrix3<f64> {
    let (c, k) = (stumpff(v.norm_squared()), hat(v));
    Matrix3::identity() + k * c[2] + k * k * c[3]
}

/// `J_r` with `Exp(v + d) ≈ Exp(v) Exp(J_r(v) d)`; equals `J_l(−v)`.
pub fn right_jacobian(v: &Vector3<f64>) -> Matrix3<f64> {
    left_jacobian(&-v)
}

/// Inverse of [`left_jacobian`], for `|v| < 2π`; infinite at one full turn.
pub fn left_jacobian_inverse(v: &Vector3<f64>) -> Matrix3<f64> {
    // (1 − (θ/2) cot(θ/2)) / θ², written so that nothing cancels for small angles.
    let (h, k) = (stumpff(v.norm_squared() / 4.0), hat(v));
    Matrix3::identity() - k * 0.5 + k * k * ((h[2] - h[3]) / (4.0 * h[1]))
}

/// Inverse of [`right_jacobian`], for `|v| < 2π`.
pub fn right_jacobian_inverse(v: &Vector3<f64>) -> Matrix3<f64> {
    left_jacobian_inverse(&-v)
}
