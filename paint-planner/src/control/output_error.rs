//! Least squares of the output error, where some numbers enter linearly and some do not.
//!
//! For given others the linear ones are solved exactly (variable projection, Golub and Pereyra 1973), so the search is over the others
//! alone, from a grid, by Levenberg's and Marquardt's method.

use nalgebra::{DMatrix, DVector};

use super::response::{Columns, MOST_COLUMNS};
use crate::error::Error;

/// Steps of the iteration, and the share of its error below which it has settled.
const STEPS: usize = 60;
const SETTLED: f64 = 1e-12;
/// Differences for the slopes.
const NUDGE: f64 = 1e-5;
const MOST: usize = MOST_COLUMNS + 3;

/// A model of what was measured: columns for its `N` numbers that do not enter linearly.
pub(super) struct OutputError<'a, const N: usize> {
    /// What was measured at each sample.
    pub(super) measured: Vec<f64>,
    /// The columns at each sample, of which the first `linear` count.
    pub(super) columns: &'a dyn Fn([f64; N]) -> Columns,
    /// How many of them there are.
    pub(super) linear: usize,
    /// Least values of the numbers.
    pub(super) least: [f64; N],
}

/// The best fit.
pub(super) struct Solution<const N: usize> {
    /// The linear numbers.
    pub(super) linear: [f64; MOST_COLUMNS],
    /// The others.
    pub(super) others: [f64; N],
    /// Sum of the squares that are left.
    pub(super) error: f64,
    /// Covariance of all numbers, the linear ones first, for independent errors alike.
    pub(super) covariance: DMatrix<f64>,
}

impl<const N: usize> OutputError<'_, N> {
    /// The best of all, from the best of some starts.
    pub(super) fn solve(&self, starts: impl Iterator<Item = [f64; N]>) -> Result<Solution<N>, Error> {
        let start = starts.map(|guess| (self.project(guess).1, guess)).min_by(|a, b| a.0.total_cmp(&b.0));
        let Some((mut error, mut guess)) = start else { return Err(Error::Recording { what: "no sample" }) };
        let mut damping = 1e-3;
        for _ in 0..STEPS {
            let (mut hessian, gradient) = self.normal_equations(guess);
            for k in 0..self.linear + N {
                hessian[(k, k)] *= 1.0 + damping;
            }
            let Some(step) = hessian.cholesky().map(|factor| factor.solve(&gradient)) else { break };
            // Only these are free here; the linear part follows them.
            let next = std::array::from_fn(|k| (guess[k] + step[self.linear + k]).max(self.least[k]));
            let reached = self.project(next).1;
            if reached <= error {
                let gained = error - reached;
                (error, guess) = (reached, next);
                damping *= 0.3;
                if gained <= SETTLED * error {
                    break;
                }
            } else {
                damping *= 10.0;
                if damping > 1e12 {
                    break;
                }
            }
        }
        let variance = error / (self.measured.len() as f64 - (self.linear + N) as f64);
        let inverse = self.normal_equations(guess).0.try_inverse();
        let covariance =
            inverse.ok_or(Error::Recording { what: "the excitation does not tell gain, lag and delay apart" })?;
        Ok(Solution { linear: self.project(guess).0, others: guess, error, covariance: covariance * variance })
    }

    /// The best linear part, and the sum of squares that it leaves; endless where columns coincide and none is the only one.
    fn project(&self, others: [f64; N]) -> ([f64; MOST_COLUMNS], f64) {
        let columns = (self.columns)(others);
        let (mut normal, mut right) = (DMatrix::zeros(self.linear, self.linear), DVector::zeros(self.linear));
        for (row, measured) in columns.iter().zip(&self.measured) {
            add(&mut normal, &mut right, &row[..self.linear], *measured);
        }
        let Some(solved) = normal.cholesky().map(|factor| factor.solve(&right)) else {
            return ([0.0; MOST_COLUMNS], f64::INFINITY);
        };
        let linear = std::array::from_fn(|k| solved.get(k).copied().unwrap_or(0.0));
        let left = columns.iter().zip(&self.measured).map(|(row, measured)| (measured - value(row, &linear)).powi(2));
        (linear, left.sum())
    }

    /// Normal equations of all numbers, the linear ones first.
    fn normal_equations(&self, others: [f64; N]) -> (DMatrix<f64>, DVector<f64>) {
        let (linear, _) = self.project(others);
        let here = (self.columns)(others);
        let sides: Vec<[Columns; 2]> = (0..N)
            .map(|k| {
                [NUDGE, -NUDGE].map(|nudge| {
                    let mut nudged = others;
                    nudged[k] += nudge;
                    (self.columns)(nudged)
                })
            })
            .collect();
        let count = self.linear + N;
        let (mut normal, mut right) = (DMatrix::zeros(count, count), DVector::zeros(count));
        for (n, (columns, measured)) in here.iter().zip(&self.measured).enumerate() {
            let mut row = [0.0; MOST];
            row[..self.linear].copy_from_slice(&columns[..self.linear]);
            for (slope, [more, less]) in row[self.linear..].iter_mut().zip(&sides) {
                *slope = (value(&more[n], &linear) - value(&less[n], &linear)) / (2.0 * NUDGE);
            }
            add(&mut normal, &mut right, &row[..count], measured - value(columns, &linear));
        }
        (normal, right)
    }
}

fn add(normal: &mut DMatrix<f64>, right: &mut DVector<f64>, row: &[f64], measured: f64) {
    for (i, a) in row.iter().enumerate() {
        for (j, b) in row.iter().enumerate() {
            normal[(i, j)] += a * b;
        }
        right[i] += a * measured;
    }
}

fn value(columns: &[f64; MOST_COLUMNS], linear: &[f64; MOST_COLUMNS]) -> f64 {
    columns.iter().zip(linear).map(|(column, factor)| column * factor).sum()
}
