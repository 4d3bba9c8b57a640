//! Whittaker's smoother: least squares between data and second differences, by a banded factorisation.

use crate::angle::nearest_equivalent;
use crate::block_tridiagonal::BlockTridiagonal;
use nalgebra::{Matrix2, Vector2};

/// Continues angles without jumps of a turn.
pub(crate) fn unwrap(angles: &[f64]) -> Vec<f64> {
    let mut result: Vec<f64> = Vec::with_capacity(angles.len());
    for &angle in angles {
        let next = result.last().map_or(angle, |&last| nearest_equivalent(angle, last));
        result.push(next);
    }
    result
}

/// Minimises `sum w_i (y_i - data_i)^2 + stiffness sum (y_{i+1} - 2 y_i + y_{i-1})^2`.
///
/// The normal equations have five diagonals; taken two unknowns at a time they are block tridiagonal.
pub(crate) fn whittaker(data: &[f64], weights: &[f64], stiffness: f64) -> Vec<f64> {
    let count = data.len();
    if count < 3 || stiffness == 0.0 {
        return data.to_vec();
    }
    let pairs = count.div_ceil(2);
    let mut system =
        BlockTridiagonal::<2> { diagonal: vec![Matrix2::zeros(); pairs], lower: vec![Matrix2::zeros(); pairs - 1] };
    let mut add = |row: usize, column: usize, value: f64| match (row / 2, column / 2) {
        (r, c) if r == c => system.diagonal[r][(row % 2, column % 2)] += value,
        (r, c) if r == c + 1 => system.lower[c][(row % 2, column % 2)] += value,
        _ => {}
    };
    for (i, &weight) in weights.iter().enumerate() {
        add(i, i, weight);
    }
    if count % 2 == 1 {
        add(count, count, 1.0);
    }
    let difference = [1.0, -2.0, 1.0];
    for i in 0..count - 2 {
        for (r, a) in difference.iter().enumerate() {
            for (c, b) in difference.iter().enumerate() {
                add(i + r, i + c, stiffness * a * b);
            }
        }
    }
    // Relative to the first value, so that a turn of the world only shifts the result.
    let offset = |i: usize| if i < count { weights[i] * (data[i] - data[0]) } else { 0.0 };
    let mut rhs: Vec<Vector2<f64>> = (0..pairs).map(|k| Vector2::new(offset(2 * k), offset(2 * k + 1))).collect();
    if !system.factor() {
        return data.to_vec();
    }
    system.solve(&mut rhs);
    rhs.iter().flat_map(|pair| [pair.x + data[0], pair.y + data[0]]).take(count).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn straight_lines_pass_and_the_optimum_is_stationary() {
        let line: Vec<f64> = (0..9).map(|i| 0.3 * f64::from(i) - 1.0).collect();
        for (a, b) in whittaker(&line, &[1.0; 9], 50.0).iter().zip(&line) {
            assert!((a - b).abs() < 1e-10);
        }
        let data = [0.0, 1.0, -0.5, 2.0, 0.3, 0.0, 1.5];
        let weights = [1.0, 2.0, 1.0, 0.5, 1.0, 3.0, 1.0];
        let cost = |y: &[f64]| {
            let fit: f64 = (0..7).map(|i| weights[i] * (y[i] - data[i]).powi(2)).sum();
            fit + 4.0 * (1..6).map(|i| (y[i + 1] - 2.0 * y[i] + y[i - 1]).powi(2)).sum::<f64>()
        };
        let y = whittaker(&data, &weights, 4.0);
        for i in 0..7 {
            for step in [-1e-3, 1e-3] {
                let mut moved = y.clone();
                moved[i] += step;
                assert!(cost(&moved) > cost(&y));
            }
        }
    }
}
