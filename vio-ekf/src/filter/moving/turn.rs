//! The gyroscope's bias from the turn of the camera.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use super::{MovingSettings, Window};

/// Images between the two of a pair: enough for the points to move.
const APART: usize = 5;
/// Iterations of the descent.
const ITERATIONS: usize = 10;
/// Step of the differences that give the second derivatives, rad/s.
const STEP: f64 = 1e-5;

/// The bias with which the points of two images, turned into common axes, have the normals of their epipolar planes in one
/// plane: the smallest eigenvalue of the sum of their squares is least (Kneip and Lynen 2013). Neither the translation nor
/// the distances matter.
pub(super) fn gyro_bias(window: &Window, settings: &MovingSettings) -> Vector3<f64> {
    let pairs = pairs(window);
    // Two noisy directions make a normal.
    let weight = 0.5 * (window.scene.focal_length / settings.pixel_sigma).powi(2);
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
    // Outside of what can be the directions are worth nothing.
    if bias.amax() < 5.0 * settings.gyro_bias_sigma { bias } else { window.gyro_bias }
}

/// Two images: the turn between them, and what both see.
struct Pair {
    /// Attitude of the second body in the axes of the first, and its derivative by the bias, on the side of the first.
    turn: UnitQuaternion<f64>,
    by_bias: Matrix3<f64>,
    made_with: Vector3<f64>,
    /// Directions in body axes.
    seen: Vec<(Vector3<f64>, Vector3<f64>)>,
}

fn pairs(window: &Window) -> Vec<Pair> {
    let camera = window.scene.camera.1;
    let pair = |second: usize| {
        let first = second - APART;
        let (from, to) = (&window.intervals[first], &window.intervals[second]);
        let first_from_window = from.rotation.inverse();
        let jacobian = (to.by_biases(0) - from.by_biases(0)).fixed_columns::<3>(0).into_owned();
        let direction = |point: &[super::Sighting], image: usize| {
            point.binary_search_by_key(&image, |s| s.0).ok().map(|k| camera * point[k].1)
        };
        let seen = window.scene.points.iter().filter_map(|p| direction(p, first).zip(direction(p, second)));
        Pair {
            turn: first_from_window * to.rotation,
            by_bias: first_from_window.to_rotation_matrix().into_inner() * jacobian,
            made_with: window.gyro_bias,
            seen: seen.collect(),
        }
    };
    (APART..window.intervals.len()).map(pair).filter(|pair| pair.seen.len() >= 8).collect()
}

impl Pair {
    /// Of half the smallest eigenvalue, by the bias.
    fn gradient(&self, bias: &Vector3<f64>) -> Vector3<f64> {
        let turn = crate::so3::exp(&(self.by_bias * (bias - self.made_with))) * self.turn;
        let mut sum = Matrix3::zeros();
        for (first, second) in &self.seen {
            let normal = first.cross(&(turn * second));
            sum += normal * normal.transpose();
        }
        let eigen = sum.symmetric_eigen();
        let along = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned();
        let mut gradient = Vector3::zeros();
        for (first, second) in &self.seen {
            let turned = turn * second;
            // along · (first × (φ × turned)) = φ · (turned × (along × first))
            gradient += turned.cross(&along.cross(first)) * along.dot(&first.cross(&turned));
        }
        self.by_bias.transpose() * gradient
    }
}
