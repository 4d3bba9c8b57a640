//! Minimum snap: the derivatives at the knots that minimise the integral of the squared snap (Richter et al.).

use crate::block_tridiagonal::BlockTridiagonal;
use nalgebra::{Matrix3, SMatrix, Vector3, Vector4};

/// Cost of one segment of unit duration, `d' U d` with `d = (p, v, a, j)` at the start, then at the end. Exact integers;
/// these are the upper rows `[A B]`, the lower ones follow from `C_ij = (-1)^(i+j) A_ij`.
const U: [[f64; 8]; 4] = [
    [100800.0, 50400.0, 10080.0, 840.0, -100800.0, 50400.0, -10080.0, 840.0],
    [50400.0, 25920.0, 5400.0, 480.0, -50400.0, 24480.0, -4680.0, 360.0],
    [10080.0, 5400.0, 1200.0, 120.0, -10080.0, 4680.0, -840.0, 60.0],
    [840.0, 480.0, 120.0, 16.0, -840.0, 360.0, -60.0, 4.0],
];

/// Entry of the cost matrix of a segment of duration `t`: `R = T^-7 D U D`, `D = diag(1, T, T^2, T^3, 1, ...)`.
fn cost(row: usize, column: usize, t: f64) -> f64 {
    let power = (row % 4 + column % 4) as i32 - 7;
    let unit = match (row < 4, column < 4) {
        (true, _) => U[row][column],
        (false, true) => U[column][row],
        (false, false) => U[row - 4][column - 4] * if (row + column).is_multiple_of(2) { 1.0 } else { -1.0 },
    };
    unit * t.powi(power)
}

/// Velocity, acceleration and jerk (rows) of four axes (columns) at one knot.
pub(crate) type KnotDerivatives = SMatrix<f64, 3, 4>;

/// Optimal derivatives at the knots of a curve that begins with the derivatives `start` and ends at rest. `None` when the system
/// is singular.
///
/// One factorisation of a block-tridiagonal system with 3x3 blocks serves all axes.
pub(crate) fn knot_derivatives(
    points: &[Vector4<f64>],
    durations: &[f64],
    start: &KnotDerivatives,
) -> Option<Vec<KnotDerivatives>> {
    let knots = points.len();
    let mut all = vec![KnotDerivatives::zeros(); knots];
    all[0] = *start;
    if knots <= 2 {
        return Some(all);
    }
    let block = |rows: usize, columns: usize, t: f64| Matrix3::from_fn(|r, c| cost(rows + r, columns + c, t));
    let mut system = BlockTridiagonal::<3>::default();
    for i in 1..knots - 1 {
        system.diagonal.push(block(5, 5, durations[i - 1]) + block(1, 1, durations[i]));
        if i + 2 < knots {
            // Rows of the knot i + 1, columns of the knot i, in the segment between.
            system.lower.push(block(5, 1, durations[i]));
        }
        // Positions enter by their differences only: the columns of start and end are opposite.
        let before = points[i] - points[i - 1];
        let after = points[i + 1] - points[i];
        let into = Vector3::from_fn(|r, _| cost(5 + r, 4, durations[i - 1]));
        let out_of = Vector3::from_fn(|r, _| cost(1 + r, 4, durations[i]));
        all[i] = -(into * before.transpose() + out_of * after.transpose());
    }
    all[1] -= block(5, 1, durations[0]) * start;
    if !system.factor() {
        return None;
    }
    system.solve(&mut all[1..knots - 1]);
    Some(all)
}

/// Snap cost of a whole curve, summed over axes.
#[cfg(test)]
pub(crate) fn total_cost(points: &[Vector4<f64>], knot_derivatives: &[KnotDerivatives], durations: &[f64]) -> f64 {
    let mut total = 0.0;
    for (i, &t) in durations.iter().enumerate() {
        for axis in 0..4 {
            let mut d = [0.0; 8];
            d[4] = points[i + 1][axis] - points[i][axis];
            for r in 0..3 {
                d[1 + r] = knot_derivatives[i][(r, axis)];
                d[5 + r] = knot_derivatives[i + 1][(r, axis)];
            }
            for r in 0..8 {
                for c in 0..8 {
                    total += d[r] * cost(r, c, t) * d[c];
                }
            }
        }
    }
    total
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};

    #[test]
    fn two_segments_of_known_optimum() {
        // Solved by hand: knots 0, 1, 3 at times 0, 1, 3.
        let points = [0.0, 1.0, 3.0].map(|x| Vector4::new(x, 0.0, 0.0, 0.0));
        let durations = [1.0, 2.0];
        let y = knot_derivatives(&points, &durations, &KnotDerivatives::zeros()).unwrap();
        for (r, expected) in [2.37654321, 1.29629630, -9.23611111].into_iter().enumerate() {
            assert!((y[1][(r, 0)] - expected).abs() < 5e-9);
        }
        assert!((total_cost(&points, &y, &durations) - 1407.2916667).abs() < 1e-6);
    }

    #[test]
    fn a_curve_that_begins_in_motion_has_the_least_snap() {
        let points: Vec<Vector4<f64>> =
            (0..4).map(|i| Vector4::from_fn(|r, _| (0.8 * f64::from(i) + r as f64).sin())).collect();
        let durations = [0.5, 0.8, 0.6];
        let start = KnotDerivatives::from_fn(|r, axis| 0.4 - 0.3 * r as f64 + 0.2 * axis as f64);
        let y = knot_derivatives(&points, &durations, &start).unwrap();
        assert_eq!((y[0], y[3]), (start, KnotDerivatives::zeros()));
        // Whichever derivative is moved either way, the snap grows, and by as much: the optimum of a quadratic.
        let least = total_cost(&points, &y, &durations);
        for (knot, r, axis) in (1..3).flat_map(|k| (0..3).flat_map(move |r| (0..4).map(move |a| (k, r, a)))) {
            let moved = |by: f64| {
                let mut other = y.clone();
                other[knot][(r, axis)] += by;
                total_cost(&points, &other, &durations) - least
            };
            let (up, down) = (moved(0.01), moved(-0.01));
            assert!(up > 0.0 && (up / down - 1.0).abs() < 1e-4, "knot {knot}, {r}, {axis}: {up} {down}");
        }
    }

    #[test]
    fn rest_to_rest_cost_is_exact() {
        let points = [Vector4::zeros(), Vector4::new(0.0, 2.0, 0.0, 0.0)];
        let cost = total_cost(&points, &knot_derivatives(&points, &[3.0], &KnotDerivatives::zeros()).unwrap(), &[3.0]);
        assert!((cost / (100800.0 * 4.0 / 3.0_f64.powi(7)) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn blocks_agree_with_a_dense_solve() {
        let count = 9;
        let durations: Vec<f64> = (0..count - 1).map(|i| 0.2 + 0.15 * ((i * i) as f64).sin().abs()).collect();
        let points: Vec<Vector4<f64>> =
            (0..count).map(|i| Vector4::from_fn(|r, _| (0.4 * i as f64 * (r + 1) as f64).sin())).collect();
        let y = knot_derivatives(&points, &durations, &KnotDerivatives::zeros()).unwrap();
        // Dense: minimise over all interior derivatives at once, columns ordered knot by knot.
        let size = 3 * (count - 2);
        let place = |knot: usize, r: usize| (knot > 0 && knot < count - 1).then(|| 3 * (knot - 1) + r);
        for axis in 0..4 {
            let mut m = DMatrix::<f64>::zeros(size, size);
            let mut rhs = DVector::<f64>::zeros(size);
            for (s, &t) in durations.iter().enumerate() {
                let slots: Vec<(usize, Option<usize>)> =
                    (0..8).map(|k| (k, if k % 4 == 0 { None } else { place(s + k / 4, k % 4 - 1) })).collect();
                for &(row, at) in &slots {
                    let Some(at) = at else { continue };
                    for &(column, other) in &slots {
                        if let Some(other) = other {
                            m[(at, other)] += cost(row, column, t);
                        }
                    }
                    rhs[at] -= cost(row, 0, t) * points[s][axis] + cost(row, 4, t) * points[s + 1][axis];
                }
            }
            let dense = m.cholesky().unwrap().solve(&rhs);
            for knot in 1..count - 1 {
                for r in 0..3 {
                    let expected = dense[3 * (knot - 1) + r];
                    assert!((y[knot][(r, axis)] - expected).abs() < 1e-9 * (1.0 + expected.abs()));
                }
            }
        }
    }
}
