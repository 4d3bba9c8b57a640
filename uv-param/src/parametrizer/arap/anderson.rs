//! Anderson acceleration of a fixed-point iteration `x <- G(x)` (Anderson 1965; for geometry Peng et al. 2018).

use nalgebra::{DMatrix, DVector};

/// Steps that are remembered (Peng et al. 2018 recommend 5).
const WINDOW: usize = 5;

/// Remembers how `G(x)` and the residual `G(x) - x` changed, and extrapolates to the residual's smallest combination.
pub(super) struct Anderson {
    last: Option<Sample>,
    /// Changes of `G(x)` and of the residual, oldest first.
    changes: Vec<Sample>,
}

struct Sample {
    image: Vec<f64>,
    residual: Vec<f64>,
}

impl Anderson {
    pub(super) fn new() -> Self {
        Self { last: None, changes: Vec::with_capacity(WINDOW + 1) }
    }

    /// Forgets everything: after an extrapolation that failed, the past is a bad guide.
    pub(super) fn reset(&mut self) {
        self.last = None;
        self.changes.clear();
    }

    /// The next iterate from `x` and `image = G(x)`.
    pub(super) fn next(&mut self, x: &[f64], image: &[f64]) -> Vec<f64> {
        let now = Sample { image: image.to_vec(), residual: difference(image, x) };
        if let Some(last) = &self.last {
            self.changes.push(Sample {
                image: difference(&now.image, &last.image),
                residual: difference(&now.residual, &last.residual),
            });
            if self.changes.len() > WINDOW {
                self.changes.remove(0);
            }
        }
        let mut next = image.to_vec();
        if let Some(weights) = self.weights(&now.residual) {
            for (change, weight) in self.changes.iter().zip(weights.iter()) {
                next.iter_mut().zip(&change.image).for_each(|(x, d)| *x -= weight * d);
            }
        }
        self.last = Some(now);
        next
    }

    /// Least squares: the combination of residual changes nearest to the residual.
    fn weights(&self, residual: &[f64]) -> Option<DVector<f64>> {
        let m = self.changes.len();
        let changes = &self.changes;
        let mut normal = DMatrix::from_fn(m, m, |i, j| dot(&changes[i].residual, &changes[j].residual));
        // Nearly parallel changes are common close to convergence; a little damping keeps the weights tame.
        let damping = 1e-12 * normal.trace();
        normal.iter_mut().step_by(m + 1).for_each(|d| *d += damping);
        let right = DVector::from_fn(m, |i, _| dot(&changes[i].residual, residual));
        (damping > 0.0).then(|| normal.cholesky().map(|c| c.solve(&right))).flatten()
    }
}

fn difference(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
