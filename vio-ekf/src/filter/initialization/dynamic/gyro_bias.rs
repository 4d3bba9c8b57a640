//! The gyroscope's bias from the rotation of the camera (Kneip and Lynen 2013).

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use super::window::{BearingObservation, InitializationWindow};
use crate::filter::settings::DynamicInitializationSettings;

/// Images from the first of a pair to the second: enough for parallax.
const PAIR_SPACING: usize = 5;
/// Iterations of the descent.
const ITERATIONS: usize = 10;
/// Step of the differences that give the second derivatives, rad/s.
const STEP: f64 = 1e-5;

/// The bias with which the points of two images, rotated into common axes, have the normals of their epipolar planes in one
/// plane: the smallest eigenvalue of the sum of their squares is least (Kneip and Lynen 2013). Neither the translation nor
/// the distances matter.
pub(super) fn gyro_bias(window: &InitializationWindow, settings: &DynamicInitializationSettings) -> Vector3<f64> {
    let pairs = pairs(window);
    // Two noisy directions make a normal.
    let weight = 0.5 * (window.input.focal_length / settings.pixel_sigma).powi(2);
    let gradient = |bias: &Vector3<f64>| {
        let mut sum = bias * settings.gyro_bias_sigma.powi(-2);
        for pair in &pairs {
            sum += pair.gradient(bias) * weight;
        }
        sum
    };
    let mut bias = window.gyro_bias;
    for _ in 0..ITERATIONS {
        let here = gradient(&bias);
        let mut curvature = Matrix3::zeros();
        for axis in 0..3 {
            let mut there = bias;
            there[axis] += STEP;
            curvature.set_column(axis, &((gradient(&there) - here) / STEP));
        }
        let Some(factor) = ((curvature + curvature.transpose()) * 0.5).cholesky() else { break };
        let step = factor.solve(&here);
        bias -= step;
        if step.norm() < 1e-6 {
            break;
        }
    }
    // A bias that no sensor has: the directions are useless.
    if bias.amax() < 5.0 * settings.gyro_bias_sigma { bias } else { window.gyro_bias }
}

/// Two images: the rotation between them, and the points in both.
struct Pair {
    /// Attitude of the second body in the axes of the first, and its derivative by the bias, on the side of the first.
    rotation: UnitQuaternion<f64>,
    by_bias: Matrix3<f64>,
    linearized_at: Vector3<f64>,
    /// Directions in body axes.
    seen: Vec<(Vector3<f64>, Vector3<f64>)>,
}

fn pairs(window: &InitializationWindow) -> Vec<Pair> {
    let camera = window.input.camera.1;
    let pair = |second: usize| {
        let first = second - PAIR_SPACING;
        let (from, to) = (&window.preintegrations[first], &window.preintegrations[second]);
        let first_from_window = from.rotation.inverse();
        let jacobian = (to.by_biases(0) - from.by_biases(0)).fixed_columns::<3>(0).into_owned();
        let direction = |point: &[BearingObservation], image: usize| {
            point.binary_search_by_key(&image, |s| s.0).ok().map(|k| camera * point[k].1)
        };
        let seen = window.input.points.iter().filter_map(|p| direction(p, first).zip(direction(p, second)));
        Pair {
            rotation: first_from_window * to.rotation,
            by_bias: first_from_window.to_rotation_matrix().into_inner() * jacobian,
            linearized_at: window.gyro_bias,
            seen: seen.collect(),
        }
    };
    (PAIR_SPACING..window.preintegrations.len()).map(pair).filter(|pair| pair.seen.len() >= 8).collect()
}

impl Pair {
    /// Of half the smallest eigenvalue, by the bias.
    fn gradient(&self, bias: &Vector3<f64>) -> Vector3<f64> {
        let rotation = crate::lie::so3::exp(&(self.by_bias * (bias - self.linearized_at))) * self.rotation;
        let mut sum = Matrix3::zeros();
        for (first, second) in &self.seen {
            let normal = first.cross(&(rotation * second));
            sum += normal * normal.transpose();
        }
        let eigen = sum.symmetric_eigen();
        let along = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned();
        let mut gradient = Vector3::zeros();
        for (first, second) in &self.seen {
            let rotated = rotation * second;
            // along · (first × (φ × rotated)) = φ · (rotated × (along × first))
            gradient += rotated.cross(&along.cross(first)) * along.dot(&first.cross(&rotated));
        }
        self.by_bias.transpose() * gradient
    }
}
