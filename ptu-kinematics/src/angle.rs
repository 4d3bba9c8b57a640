//! Angles and the elementary rotation of the tilt joint.

use nalgebra::{Rotation3, Vector3};

/// Wraps an angle in radians into `(-π, π]`.
///
/// ```
/// use std::f64::consts::PI;
/// assert!((ptu_kinematics::wrap(1.5 * PI) + 0.5 * PI).abs() < 1e-15);
/// assert_eq!((ptu_kinematics::wrap(-PI), ptu_kinematics::wrap(PI)), (PI, PI));
/// ```
pub fn wrap(angle: f64) -> f64 {
    let turns = (angle / std::f64::consts::TAU).round();
    let wrapped = angle - turns * std::f64::consts::TAU;
    if wrapped <= -std::f64::consts::PI { wrapped + std::f64::consts::TAU } else { wrapped }
}

/// `Ry(-angle)`: the right-handed rotation about `-y`, which raises the x axis by `angle`.
pub(crate) fn elevation_rotation(angle: f64) -> Rotation3<f64> {
    Rotation3::from_axis_angle(&-Vector3::y_axis(), angle)
}
