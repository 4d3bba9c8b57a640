//! Linearisation, gate and update of a [`Measurement`].

use nalgebra::SVector;

use super::measurement::{Measurement, Trial};
use crate::filter::estimator::Estimator;
use crate::inertial::covariance::LinearizedMeasurement;
use crate::inertial::iterated_update::{Iteration, iterate, mahalanobis};

/// Length of a last step, in units of the prior's deviation.
const TOLERANCE: f64 = 1e-3;

/// Linearises once, at the state.
pub(crate) fn linearize_at_state<const M: usize, const C: usize>(
    estimator: &Estimator,
    measurement: &impl Measurement<M, C>,
) -> Option<LinearizedMeasurement<M, C>> {
    let (rows, delta) = (measurement.rows(), SVector::zeros());
    let trial = Trial { state: &estimator.state, rate_in_body: &estimator.rate, rows: &rows, delta: &delta };
    let at_state = measurement.linearize(&trial)?;
    let (residual, jacobian, noise) = (at_state.residual, at_state.jacobian, at_state.noise);
    Some(LinearizedMeasurement { rows, residual, jacobian, noise })
}

/// Linearises again and again, from a first trial step to the mode of the posterior.
pub(crate) fn linearize_iterated<const M: usize, const C: usize>(
    estimator: &Estimator,
    measurement: &impl Measurement<M, C>,
    iteration: Iteration,
    first: SVector<f64, C>,
) -> Option<LinearizedMeasurement<M, C>> {
    let rows = measurement.rows();
    iterate(&estimator.covariance, rows, iteration, first, |delta| {
        measurement.linearize(&Trial { state: &estimator.state, rate_in_body: &estimator.rate, rows: &rows, delta })
    })
}

/// Whether a measurement passes a gate.
pub(crate) fn passes_gate<const M: usize, const C: usize>(
    estimator: &Estimator,
    measurement: &LinearizedMeasurement<M, C>,
    gate: f64,
) -> bool {
    mahalanobis(&estimator.covariance, measurement).is_some_and(|distance| distance <= gate)
}

/// Updates with a measurement unless its gate, or the numbers, refuse it; returns whether it was used.
pub(crate) fn gated_update<const M: usize, const C: usize>(
    estimator: &mut Estimator,
    measurement: &impl Measurement<M, C>,
) -> bool {
    let linearized = match measurement.max_iterations() {
        0 | 1 => linearize_at_state(estimator, measurement),
        limit => {
            let iteration = Iteration { limit, tolerance: TOLERANCE };
            linearize_iterated(estimator, measurement, iteration, SVector::zeros())
        }
    };
    linearized.is_some_and(|m| passes_gate(estimator, &m, measurement.gate()) && estimator.update(&m))
}

/// Updates without a gate; returns whether it was possible.
pub(crate) fn ungated_update<const M: usize, const C: usize>(
    estimator: &mut Estimator,
    measurement: &impl Measurement<M, C>,
) -> bool {
    linearize_at_state(estimator, measurement).is_some_and(|m| estimator.update(&m))
}
