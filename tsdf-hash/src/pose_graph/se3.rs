//! The group of rigid motions: exponential, logarithm, adjoint, and the Jacobian of the logarithm (Barfoot 2017, sections 8.1.3 to
//! 8.1.5). Twists are `(ω, v)`: a turn in radians before a shift in metres.

use nalgebra::{Isometry3, Matrix3, Matrix6, Translation3, UnitQuaternion, Vector3, Vector6};

/// Below this angle, radians, series take the place of quotients that cancel.
const SMALL: f64 = 0.05;

/// Parts of a twist.
fn parts(twist: &Vector6<f64>) -> (Vector3<f64>, Vector3<f64>) {
    (twist.fixed_rows::<3>(0).into_owned(), twist.fixed_rows::<3>(3).into_owned())
}

/// `(1 − cos θ) / θ²` and `(θ − sin θ) / θ³`.
fn coefficients(angle: f64) -> [f64; 2] {
    let square = angle * angle;
    if angle < SMALL {
        [0.5 - square / 24.0 * (1.0 - square / 30.0), 1.0 / 6.0 - square / 120.0 * (1.0 - square / 42.0)]
    } else {
        [(1.0 - angle.cos()) / square, (angle - angle.sin()) / (square * angle)]
    }
}

/// The left Jacobian of SO(3).
fn left_jacobian(turn: &Vector3<f64>) -> Matrix3<f64> {
    let (w, [a, b]) = (turn.cross_matrix(), coefficients(turn.norm()));
    Matrix3::identity() + a * w + b * w * w
}

/// Its inverse, for angles up to π.
fn left_jacobian_inverse(turn: &Vector3<f64>) -> Matrix3<f64> {
    let (w, angle) = (turn.cross_matrix(), turn.norm());
    let square = angle * angle;
    let c = if angle < SMALL {
        1.0 / 12.0 + square / 720.0 * (1.0 + square / 42.0)
    } else {
        (1.0 - 0.5 * angle / (0.5 * angle).tan()) / square
    };
    Matrix3::identity() - 0.5 * w + c * w * w
}

pub(crate) fn exp(twist: &Vector6<f64>) -> Isometry3<f64> {
    let (turn, shift) = parts(twist);
    let translation = Translation3::from(left_jacobian(&turn) * shift);
    Isometry3::from_parts(translation, UnitQuaternion::from_scaled_axis(turn))
}

/// The twist of the shorter way round.
pub(crate) fn log(pose: &Isometry3<f64>) -> Vector6<f64> {
    let turn = pose.rotation.scaled_axis();
    let shift = left_jacobian_inverse(&turn) * pose.translation.vector;
    Vector6::new(turn.x, turn.y, turn.z, shift.x, shift.y, shift.z)
}

fn blocks(upper_left: &Matrix3<f64>, lower_left: &Matrix3<f64>) -> Matrix6<f64> {
    let mut out = Matrix6::zeros();
    out.fixed_view_mut::<3, 3>(0, 0).copy_from(upper_left);
    out.fixed_view_mut::<3, 3>(3, 0).copy_from(lower_left);
    out.fixed_view_mut::<3, 3>(3, 3).copy_from(upper_left);
    out
}

/// `exp(Ad ξ) = T exp(ξ) T⁻¹`.
pub(crate) fn adjoint(pose: &Isometry3<f64>) -> Matrix6<f64> {
    let rotation = pose.rotation.to_rotation_matrix().into_inner();
    blocks(&rotation, &(pose.translation.vector.cross_matrix() * rotation))
}

/// `J` with `log(T exp(ξ)) ≈ log(T) + J ξ`.
pub(crate) fn right_jacobian_inverse(log: &Vector6<f64>) -> Matrix6<f64> {
    // The left one of the opposite twist.
    let (turn, shift) = parts(&-log);
    let inverse = left_jacobian_inverse(&turn);
    blocks(&inverse, &(-inverse * coupling(&turn, &shift) * inverse))
}

/// The lower left block of the left Jacobian of SE(3).
fn coupling(turn: &Vector3<f64>, shift: &Vector3<f64>) -> Matrix3<f64> {
    let (w, v, angle) = (turn.cross_matrix(), shift.cross_matrix(), turn.norm());
    let square = angle * angle;
    let [_, b] = coefficients(angle);
    let (c, d) = if angle < SMALL {
        // (θ²/2 − 1 + cos θ) / θ⁴ and half of (2θ − 3 sin θ + θ cos θ) / θ⁵.
        (1.0 / 24.0 - square / 720.0 * (1.0 - square / 56.0), 1.0 / 120.0 - square / 2520.0 * (1.0 - square / 48.0))
    } else {
        (
            (0.5 * square - 1.0 + angle.cos()) / (square * square),
            0.5 * (2.0 * angle - 3.0 * angle.sin() + angle * angle.cos()) / (square * square * angle),
        )
    };
    let wv = w * v;
    let vw = v * w;
    let wvw = wv * w;
    0.5 * v + b * (wv + vw + wvw) + c * (w * wv + vw * w - 3.0 * wvw) + d * (wvw * w + w * wvw)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn twists() -> [Vector6<f64>; 5] {
        [
            Vector6::new(0.3, -0.2, 0.7, 1.0, -2.0, 0.5),
            Vector6::new(1e-3, 2e-3, -1e-3, 0.4, 0.1, 3.0),
            Vector6::new(0.03, 0.03, 0.03, -1.0, 2.0, 0.3),
            Vector6::new(0.0, 0.0, 0.0, 1.0, 2.0, 3.0),
            Vector6::new(1.9, -1.6, 1.7, 0.3, 0.9, -0.4),
        ]
    }

    /// The exponential of a 4 x 4 matrix by its series.
    #[test]
    fn the_exponential_is_that_of_the_matrix() {
        for twist in twists() {
            let mut m = nalgebra::Matrix4::zeros();
            let (turn, shift) = parts(&twist);
            m.fixed_view_mut::<3, 3>(0, 0).copy_from(&turn.cross_matrix());
            m.fixed_view_mut::<3, 1>(0, 3).copy_from(&shift);
            let (mut sum, mut term) = (nalgebra::Matrix4::identity(), nalgebra::Matrix4::identity());
            for k in 1..60 {
                term = term * m / f64::from(k);
                sum += term;
            }
            assert!((exp(&twist).to_homogeneous() - sum).amax() < 1e-12, "{twist}");
            assert!((log(&exp(&twist)) - twist).amax() < 1e-11, "{twist}");
        }
    }

    #[test]
    fn the_adjoint_moves_twists_through_a_pose() {
        let (pose, twist) = (exp(&twists()[0]), twists()[2]);
        let apart = exp(&(adjoint(&pose) * twist)).inverse() * (pose * exp(&twist) * pose.inverse());
        assert!(log(&apart).norm() < 1e-12);
    }

    #[test]
    fn the_jacobian_is_that_of_central_differences() {
        for twist in twists() {
            let (pose, h) = (exp(&twist), 1e-5);
            let jacobian = right_jacobian_inverse(&log(&pose));
            for k in 0..6 {
                let step = Vector6::from_fn(|row, _| if row == k { h } else { 0.0 });
                let difference = (log(&(pose * exp(&step))) - log(&(pose * exp(&-step)))) / (2.0 * h);
                assert!((difference - jacobian.column(k)).amax() < 1e-8, "{twist} {k}");
            }
        }
    }
}
