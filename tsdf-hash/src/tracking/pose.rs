//! Small changes of a pose: a turn and a shift about the camera, along the axes of the world.

use nalgebra::{Isometry3, Matrix6, Translation3, UnitQuaternion, Vector3, Vector6};

/// `(exp(ω) R, t + v)`, of unit length however often it is done.
pub(crate) fn moved(pose: &Isometry3<f64>, step: &Vector6<f64>) -> Isometry3<f64> {
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(step[0], step[1], step[2]));
    let shift = Vector3::new(step[3], step[4], step[5]);
    Isometry3::from_parts(
        Translation3::from(pose.translation.vector + shift),
        UnitQuaternion::new_normalize((turn * pose.rotation).into_inner()),
    )
}

/// The step from one pose to another: `moved(from, &step(from, to)) = to`.
pub(crate) fn step(from: &Isometry3<f64>, to: &Isometry3<f64>) -> Vector6<f64> {
    let turn = (to.rotation * from.rotation.inverse()).scaled_axis();
    let shift = to.translation.vector - from.translation.vector;
    Vector6::new(turn.x, turn.y, turn.z, shift.x, shift.y, shift.z)
}

/// The covariance of a step along other axes.
pub(crate) fn rotated(covariance: &Matrix6<f64>, to_from: &UnitQuaternion<f64>) -> Matrix6<f64> {
    let turn = to_from.to_rotation_matrix().into_inner();
    let mut axes = Matrix6::zeros();
    axes.fixed_view_mut::<3, 3>(0, 0).copy_from(&turn);
    axes.fixed_view_mut::<3, 3>(3, 3).copy_from(&turn);
    axes * covariance * axes.transpose()
}

/// Whether two poses are so near to each other: radians, metres.
pub(crate) fn within(a: &Isometry3<f64>, b: &Isometry3<f64>, [turn, shift]: [f64; 2]) -> bool {
    let apart = step(a, b);
    apart.fixed_rows::<3>(0).norm() <= turn && apart.fixed_rows::<3>(3).norm() <= shift
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_leads_there() {
        let a = Isometry3::new(Vector3::new(1.0, -2.0, 0.5), Vector3::new(0.3, 0.9, -0.4));
        let b = Isometry3::new(Vector3::new(0.7, -1.8, 0.1), Vector3::new(-0.5, 0.2, 0.8));
        let error = moved(&a, &step(&a, &b)).inverse() * b;
        assert!(error.translation.vector.norm() + error.rotation.angle() < 1e-12);
    }
}
