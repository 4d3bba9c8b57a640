//! The iterated Kalman update, and the gate.

use nalgebra::{SMatrix, SVector};

use super::covariance::{Covariance, LinearizedMeasurement};

/// A measurement linearised at a trial state `x ⊞ δ`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Linearization<const M: usize, const C: usize> {
    /// Measured minus predicted at the trial state.
    pub residual: SVector<f64, M>,
    /// Derivative of the prediction by the rows in question, at the trial state.
    pub jacobian: SMatrix<f64, M, C>,
    /// Covariance of the measurement's noise.
    pub noise: SMatrix<f64, M, M>,
}

/// When the iteration ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Iteration {
    /// Largest number of linearisations.
    pub(crate) limit: usize,
    /// Length of the last step, in units of its own standard deviation, that counts as none.
    pub(crate) tolerance: f64,
}

/// The iterated Kalman update of Bell and Cathey 1993, reduced to the rows that the measurement depends on.
///
/// With `H`, `y` at the trial `δ` the next trial is `P Hᵀ (H P Hᵀ + S)⁻¹ (y + H δ)`: Gauss-Newton on the posterior cost.
/// The prior `P` is the same in all iterations, wherever the `first` trial is. What is returned is the measurement to update with, its residual moved back
/// to `δ = 0`; the whole state and covariance are touched once, by that update. `None` if some linearisation fails.
pub(crate) fn iterate<const M: usize, const C: usize>(
    covariance: &Covariance,
    rows: [usize; C],
    iteration: Iteration,
    first: SVector<f64, C>,
    mut linearize: impl FnMut(&SVector<f64, C>) -> Option<Linearization<M, C>>,
) -> Option<LinearizedMeasurement<M, C>> {
    let prior = covariance.marginal(&rows);
    let mut delta = first;
    for left in (0..iteration.limit.max(1)).rev() {
        let Linearization { residual, jacobian, noise } = linearize(&delta)?;
        let measurement = LinearizedMeasurement { rows, residual: residual + jacobian * delta, jacobian, noise };
        let gain_transposed = (jacobian * prior * jacobian.transpose() + noise).cholesky()?.solve(&(jacobian * prior));
        let next = gain_transposed.transpose() * measurement.residual;
        let step = next - delta;
        delta = next;
        // In units of the prior's deviations: a step in time and one in angle are then comparable.
        let small = (0..C).all(|k| step[k] * step[k] <= iteration.tolerance * iteration.tolerance * prior[(k, k)]);
        if small || left == 0 {
            return delta.iter().all(|d| d.is_finite()).then_some(measurement);
        }
    }
    None
}

/// Squared Mahalanobis length of a measurement's residual.
pub(crate) fn mahalanobis<const M: usize, const C: usize>(
    covariance: &Covariance,
    measurement: &LinearizedMeasurement<M, C>,
) -> Option<f64> {
    let factor = covariance.innovation(measurement).cholesky()?;
    Some(measurement.residual.dot(&factor.solve(&measurement.residual)))
}
