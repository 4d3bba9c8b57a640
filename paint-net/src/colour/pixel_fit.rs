//! The paints of one pixel: Gauss-Newton with damping (Levenberg 1944) on a box, free variables as Bertsekas (1982) has them.

use super::colour_metric::ciede2000_rows;
use super::mixing_model::{MOST_PAINTS, MixingModel};

/// What the fit of a pixel weighs.
#[derive(Clone, Copy)]
pub(super) struct PixelFit<'a> {
    pub(super) model: &'a dyn MixingModel,
    /// Depth beyond which no paint goes.
    pub(super) deepest: f64,
    /// What a unit of depth costs, and half of the cost of its square.
    pub(super) paint_weight: f64,
    pub(super) spread_weight: f64,
    pub(super) iterations: usize,
}

/// Smaller gains end the fit, in halves of a squared colour difference.
const LEAST_GAIN: f64 = 1e-4;
const MOST_DAMPING: f64 = 1e8;

impl PixelFit<'_> {
    /// Changes the depths from where they are; the cost in the end, and the colour there.
    pub(super) fn solve(&self, pixel: usize, wanted: [f64; 3], depths: &mut [f64]) -> (f64, [f64; 3]) {
        let (n, rows) = (depths.len(), ciede2000_rows(wanted));
        let (mut slopes, mut trial_slopes) = ([[0.0; 3]; MOST_PAINTS], [[0.0; 3]; MOST_PAINTS]);
        let mut lab = self.model.lab(pixel, depths, &mut slopes[..n]);
        let mut residual = times(&rows, difference(lab, wanted));
        let mut cost = self.cost(depths, residual);
        let mut damping = 1.0;
        for _ in 0..self.iterations {
            let (mut columns, mut gradient) = ([[0.0; 3]; MOST_PAINTS], [0.0; MOST_PAINTS]);
            let tau = self.spread_weight + damping;
            let (mut normal, mut along) = ([[tau, 0.0, 0.0], [0.0, tau, 0.0], [0.0, 0.0, tau]], [0.0; 3]);
            for p in 0..n {
                let column = times(&rows, slopes[p]);
                let slope = dot(column, residual) + self.paint_weight + self.spread_weight * depths[p];
                let held = depths[p] <= 0.0 && slope >= 0.0 || depths[p] >= self.deepest && slope <= 0.0;
                if !held {
                    (columns[p], gradient[p]) = (column, slope);
                    for i in 0..3 {
                        along[i] += column[i] * slope;
                        for j in 0..3 {
                            normal[i][j] += column[i] * column[j];
                        }
                    }
                }
            }
            // (AᵀA + τ)⁻¹ g = (g - Aᵀ (τ + A Aᵀ)⁻¹ A g) / τ, three equations for any number of paints.
            let inner = solve3(&normal, along);
            let mut trial = [0.0; MOST_PAINTS];
            for p in 0..n {
                let step = (gradient[p] - dot(columns[p], inner)) / tau;
                trial[p] = (depths[p] - step).clamp(0.0, self.deepest);
            }
            let trial_lab = self.model.lab(pixel, &trial[..n], &mut trial_slopes[..n]);
            let trial_residual = times(&rows, difference(trial_lab, wanted));
            let trial_cost = self.cost(&trial[..n], trial_residual);
            let gain = cost - trial_cost;
            if gain > 0.0 {
                depths.copy_from_slice(&trial[..n]);
                (cost, lab, residual) = (trial_cost, trial_lab, trial_residual);
                std::mem::swap(&mut slopes, &mut trial_slopes);
                damping = (0.1 * damping).max(1e-6);
                if gain < LEAST_GAIN {
                    break;
                }
            } else {
                damping *= 10.0;
                if damping > MOST_DAMPING || gain > -LEAST_GAIN * LEAST_GAIN {
                    break;
                }
            }
        }
        (cost, lab)
    }

    fn cost(&self, depths: &[f64], residual: [f64; 3]) -> f64 {
        let paint = |d: &f64| self.paint_weight * d + 0.5 * self.spread_weight * d * d;
        0.5 * dot(residual, residual) + depths.iter().map(paint).sum::<f64>()
    }
}

pub(super) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(super) fn times(rows: &[[f64; 3]; 3], v: [f64; 3]) -> [f64; 3] {
    rows.map(|row| dot(row, v))
}

pub(super) fn difference(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// By Cramer's rule; the matrix is positive definite.
fn solve3(m: &[[f64; 3]; 3], v: [f64; 3]) -> [f64; 3] {
    let cross =
        |a: [f64; 3], b: [f64; 3]| [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let columns = [cross(m[1], m[2]), cross(m[2], m[0]), cross(m[0], m[1])];
    let determinant = dot(m[0], columns[0]);
    std::array::from_fn(|i| (0..3).map(|k| columns[k][i] * v[k]).sum::<f64>() / determinant)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Paint that changes nothing: the cost alone counts.
    struct Clear;

    impl MixingModel for Clear {
        fn paints(&self) -> usize {
            2
        }

        fn lab(&self, _: usize, _: &[f64], _: &mut [[f64; 3]]) -> [f64; 3] {
            [50.0, 0.0, 0.0]
        }
    }

    #[test]
    fn paint_costs_by_its_depth_and_by_its_square() {
        let fit = PixelFit { model: &Clear, deepest: 9.0, paint_weight: 3.0, spread_weight: 8.0, iterations: 1 };
        // (3² + 4²) / 2 + 3 (1 + 2) + 8 (1² + 2²) / 2
        assert_eq!(fit.cost(&[1.0, 2.0], [3.0, 0.0, 4.0]), 12.5 + 9.0 + 20.0);
    }
}
