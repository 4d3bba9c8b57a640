//! Velocity, gravity and distances from linear equations (Martinelli 2014).

use nalgebra::{Matrix6, SMatrix, SVector, Vector6};

use super::window::{BIASES, GLOBAL, GRAVITY, InitializationWindow};
use crate::lie::so3;

/// Prior distance of a point, for one without parallax, and its weight, per m².
const PRIOR_DISTANCE: (f64, f64) = (4.0, 1e-5);

/// Least squares on `m_j × (d R_a m_a + r_a − r_j) = 0` for each observation `j` of a point first seen in image `a`, with the
/// camera's place `r = v t + g t²/2 + α + R t_bc`. The second time each equation is divided by the distance that the first
/// has found, so that it counts as an angle.
pub(super) fn closed_form(window: &InitializationWindow, kept: &[usize]) -> Option<(SVector<f64, GLOBAL>, Vec<f64>)> {
    let mut global = SVector::<f64, GLOBAL>::zeros();
    global.fixed_rows_mut::<3>(BIASES).copy_from(&window.gyro_bias);
    let mut distances = vec![PRIOR_DISTANCE.0; kept.len()];
    for _ in 0..2 {
        let solution;
        (solution, distances) = weighted(window, kept, &global, &distances)?;
        global.fixed_rows_mut::<6>(0).copy_from(&solution);
        for distance in &mut distances {
            *distance = if *distance > 0.0 { distance.clamp(0.1, 100.0) } else { PRIOR_DISTANCE.0 };
        }
    }
    let long = global.fixed_rows::<3>(GRAVITY).norm();
    // Gravity that is off by half is no place to begin from.
    let wrong = long.is_nan() || (long - window.input.gravity).abs() > 0.5 * window.input.gravity;
    (!wrong).then(|| (global, distances.iter().map(|d| 1.0 / d).collect()))
}

fn weighted(
    window: &InitializationWindow,
    kept: &[usize],
    global: &SVector<f64, GLOBAL>,
    guesses: &[f64],
) -> Option<(Vector6<f64>, Vec<f64>)> {
    let (lever, camera) = &window.input.camera;
    let change = window.bias_change(&global.fixed_rows::<6>(BIASES).into_owned());
    let poses: Vec<_> =
        window.preintegrations.iter().map(|preintegration| preintegration.with_biases(&change)).collect();
    let (mut matrix, mut vector) = (Matrix6::zeros(), Vector6::zeros());
    let mut back = Vec::with_capacity(kept.len());
    for (&point, guess) in kept.iter().zip(guesses) {
        let (anchor, direction) = window.input.points[point][0];
        let (turned, _, moved) = &poses[anchor];
        let began = window.preintegrations[anchor].duration;
        let first = turned * (camera * direction);
        let weight = 1.0 / (guess * guess);
        let (mut hh, mut hg, mut h) = (PRIOR_DISTANCE.1, Vector6::<f64>::zeros(), PRIOR_DISTANCE.0 * PRIOR_DISTANCE.1);
        for (image, direction) in &window.input.points[point][1..] {
            let (rotation, _, position) = &poses[*image];
            let time = window.preintegrations[*image].duration;
            let cross = so3::hat(&(rotation * (camera * direction)));
            let known = cross * (position + rotation * lever - moved - turned * lever);
            let by_distance = cross * first;
            let mut by_global = SMatrix::<f64, 3, 6>::zeros();
            by_global.fixed_columns_mut::<3>(0).copy_from(&(cross * (began - time)));
            by_global.fixed_columns_mut::<3>(3).copy_from(&(cross * (0.5 * (began * began - time * time))));
            hh += weight * by_distance.norm_squared();
            hg += by_global.transpose() * by_distance * weight;
            h += weight * by_distance.dot(&known);
            matrix += by_global.transpose() * by_global * weight;
            vector += by_global.transpose() * known * weight;
        }
        matrix -= hg * hg.transpose() / hh;
        vector -= hg * (h / hh);
        back.push((h / hh, hg / hh));
    }
    let solution = matrix.cholesky()?.solve(&vector);
    Some((solution, back.iter().map(|(a, b)| a - b.dot(&solution)).collect()))
}
