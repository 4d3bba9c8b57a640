//! Whether the accelerometer is calibrated: estimates its matrix at first, and goes on with it only if it is not the identity.

use nalgebra::{Matrix3, SMatrix, Vector3};

use super::calibration_prior::{Entries, prior_sigma};
use super::estimator::Estimator;
use super::innovation_adaptation::Correction;
use super::state::error_state::{ACCEL_MATRIX, MATRIX_SIZE};
use crate::inertial::imu_noise_estimator::ImuSettings;
use crate::trace::event;

type Information = SMatrix<f64, MATRIX_SIZE, MATRIX_SIZE>;

/// Seconds of motion before the identity is chosen.
const TRIAL_S: f64 = 2.0;
/// Logarithm of the density ratio above which the identity is chosen at first.
const MORE_PROBABLE: f64 = 0.0;
/// The same once it has been chosen, and contradicted.
const CONVINCING: f64 = 3.0;
/// Factor on the accelerometer's noise from which on errors of the matrix do not explain what is corrected.
const UNEXPLAINED: f64 = 3.0;
/// Seconds whose corrections are judged together.
const WINDOW_S: f64 = 2.0;
/// The statistic of a window from which on the matrix is estimated again: one sound window in 2500.
const CONTRADICTION: f64 = 30.0;

/// Chooses between two models of the accelerometer, `A = I` and `A` with its prior `Σ₀`.
///
/// Once the body moves the second one is on trial. Once the identity is more probable than it was (the Savage-Dickey density ratio;
/// Dickey 1971) it is chosen: the estimate is conditioned on `A = I`, which leaves what a filter would have found that had known it
/// from the start. After the choice of the identity a score test (Rao 1948) watches the corrections, and a contradiction reopens the
/// case.
#[allow(clippy::large_enum_variant, reason = "no allocation while the filter runs, so no box")]
#[derive(Debug, Clone)]
pub(crate) enum AccelMatrixSelection {
    /// Nothing has moved yet.
    Waiting,
    /// Estimated for so many seconds of motion, until the density ratio is above `enough`.
    Estimated {
        duration: f64,
        enough: f64,
    },
    Identity(ScoreTest),
}

impl AccelMatrixSelection {
    /// Takes what an image of a moving body has corrected, the factor on the accelerometer's noise that such corrections have led to, and
    /// whether the body has been at rest before.
    pub(crate) fn update(
        &mut self,
        correction: &Correction,
        (noise_factor, rested): (f64, bool),
        estimator: &mut Estimator,
        settings: &ImuSettings,
    ) {
        match self {
            Self::Waiting => {
                // What was measured at rest is the bias that goes with `A = I`.
                let reading = if rested { estimator.impulse.0 / estimator.impulse.1 } else { Vector3::zeros() };
                estimator.estimate_accel_matrix(&prior_sigma(settings), &reading);
                *self = Self::Estimated { duration: 0.0, enough: MORE_PROBABLE };
            }
            Self::Estimated { duration, enough } => {
                *duration += estimator.impulse.1;
                let Some(ratio) = log_density_ratio(estimator, &prior_sigma(settings)) else { return };
                if *duration >= TRIAL_S && (ratio > *enough || noise_factor > UNEXPLAINED) {
                    event!(debug, ratio, noise_factor, "accelerometer taken as calibrated");
                    estimator.fix_accel_matrix();
                    *self = Self::Identity(ScoreTest::default());
                }
            }
            Self::Identity(test) => {
                let prior = prior_sigma(settings);
                if let Some(mean_reading) = test.update(&correction.velocity, &estimator.impulse, &prior) {
                    event!(info, "accelerometer is not calibrated any more: scale and axes are estimated");
                    estimator.estimate_accel_matrix(&prior, &mean_reading);
                    *self = Self::Estimated { duration: 0.0, enough: CONVINCING };
                }
            }
        }
    }
}

/// Logarithm of the posterior over the prior density of `A = I`.
fn log_density_ratio(estimator: &Estimator, prior: &Entries) -> Option<f64> {
    let error = (estimator.state.accel_matrix() - Matrix3::identity()).transpose();
    // In units of the prior.
    let scale = Information::from_diagonal(&prior.map(f64::recip));
    let posterior = scale * estimator.covariance.block::<MATRIX_SIZE, MATRIX_SIZE>(ACCEL_MATRIX, ACCEL_MATRIX) * scale;
    let factor = posterior.cholesky()?;
    let error = scale * Entries::from_iterator(error.iter().copied());
    let ratio = -factor.l_dirty().diagonal().map(f64::ln).sum() - 0.5 * error.dot(&factor.solve(&error));
    ratio.is_finite().then_some(ratio)
}

/// The score test of `A = I`.
///
/// An image corrects the velocity by `δ`, whose covariance is `G = P⁻ − P⁺` if all is as modelled. An error `ε` of the matrix moves
/// the velocity by `ε u`, where `u` is the reading integrated since the image before. So `s = Σ (G⁻¹ δ) uᵀ` has the mean zero and
/// the covariance `I = Σ G⁻¹ ⊗ u uᵀ` where there is none, and `sᵀ (I + Σ₀⁻¹)⁻¹ s` exceeds no more often than chi-squared with
/// nine degrees of freedom.
#[derive(Debug, Clone)]
pub(crate) struct ScoreTest {
    score: Matrix3<f64>,
    information: Information,
    impulse: Vector3<f64>,
    duration: f64,
}

impl Default for ScoreTest {
    fn default() -> Self {
        Self { score: Matrix3::zeros(), information: Information::zeros(), impulse: Vector3::zeros(), duration: 0.0 }
    }
}

impl ScoreTest {
    /// Takes the correction of the velocity by an image, and the impulse since the image before. Where the window that ends here speaks
    /// against `A = I`: its mean reading.
    fn update(
        &mut self,
        (correction, gain): &(Vector3<f64>, Matrix3<f64>),
        (impulse, duration): &(Vector3<f64>, f64),
        prior: &Entries,
    ) -> Option<Vector3<f64>> {
        let weight = gain.cholesky()?.inverse();
        self.score += weight * correction * impulse.transpose();
        self.information += weight.kronecker(&(impulse * impulse.transpose()));
        self.impulse += impulse;
        self.duration += duration;
        if self.duration < WINDOW_S {
            return None;
        }
        let window = std::mem::take(self);
        let statistic = window.statistic(prior)?;
        (statistic > CONTRADICTION).then(|| window.impulse / window.duration)
    }

    /// `sᵀ (I + Σ₀⁻¹)⁻¹ s`.
    fn statistic(&self, prior: &Entries) -> Option<f64> {
        let score = Entries::from_fn(|k, _| self.score[(k / 3, k % 3)]);
        let posterior =
            (self.information + Information::from_diagonal(&prior.map(|sigma| sigma.powi(-2)))).cholesky()?;
        Some(score.dot(&posterior.solve(&score)))
    }
}
