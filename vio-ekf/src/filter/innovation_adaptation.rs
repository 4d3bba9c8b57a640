//! Innovation-based adaptive estimation: inertial readings that the images keep contradicting count less.

use nalgebra::{Matrix3, Vector3};

use super::estimator::Estimator;
use super::state::error_state;
use crate::inertial::core_state::CoreState;
use crate::lie::so3;

/// Change of the logarithm of a variance per image, per unit of excess.
const RATE: f64 = 0.1;
/// Squared corrections are tolerated up to this many times what is expected of them: chance must not widen the noise.
const TOLERATED: f64 = 2.0;
/// One image counts for no more than this excess.
const MAX_EXCESS: f64 = 10.0;

/// Factors on the noise of the inertial sensor, from how far images correct velocity and attitude (Mehra 1972; Mohamed and Schwarz
/// 1999).
///
/// What an image corrects has the covariance `P⁻ − P⁺` if all is as modelled, so that its squared length in these units is 3 in the
/// mean. A sensor whose errors are larger than its data sheet admits, for what reason ever, shows there. Its noise grows while the
/// corrections are too long, and falls back to the data sheet's while they are not.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct InnovationAdaptation {
    /// Logarithm of the factor on the variance, of gyroscope and accelerometer; not negative.
    log_variance: [f64; 2],
    /// Sum over images, see [`contradiction`](Self::contradiction).
    contradiction: f64,
}

/// What is corrected by an image, as it was before.
#[derive(Debug, Clone, Copy)]
pub(crate) struct BeforeImage {
    core: CoreState,
    velocity: Matrix3<f64>,
    attitude: Matrix3<f64>,
}

/// What an image has corrected, each with the covariance `P⁻ − P⁺` that it has if all is as modelled.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Correction {
    pub(crate) attitude: (Vector3<f64>, Matrix3<f64>),
    pub(crate) velocity: (Vector3<f64>, Matrix3<f64>),
}

impl BeforeImage {
    pub(crate) fn new(estimator: &Estimator) -> Self {
        let [velocity, attitude] = blocks(estimator);
        Self { core: estimator.state.core, velocity, attitude }
    }

    /// What has been corrected since.
    pub(crate) fn correction(&self, estimator: &Estimator) -> Correction {
        let now = &estimator.state.core;
        let [velocity, attitude] = blocks(estimator);
        let turned = so3::log(&(now.attitude * self.core.attitude.inverse()));
        Correction {
            attitude: (turned, self.attitude - attitude),
            velocity: (now.velocity - self.core.velocity, self.velocity - velocity),
        }
    }
}

impl InnovationAdaptation {
    /// Learns from the corrections of an image; `max_factor` bounds the factors.
    pub(crate) fn update(&mut self, correction: &Correction, max_factor: f64) {
        self.learn([&correction.attitude, &correction.velocity].map(squared_length), max_factor);
    }

    /// From the squared lengths of the corrections of attitude and velocity, in units of their covariance.
    fn learn(&mut self, lengths: [Option<f64>; 2], max_factor: f64) {
        let most = 2.0 * max_factor.ln();
        for (log_variance, length) in self.log_variance.iter_mut().zip(lengths) {
            let Some(length) = length else { continue };
            self.contradiction += (length / 3.0).min(MAX_EXCESS) + *log_variance;
            *log_variance = (*log_variance + RATE * (length / 3.0 - TOLERATED).min(MAX_EXCESS)).clamp(0.0, most);
        }
    }

    /// How much images and inertial samples have contradicted each other, a sum over images: of two filters over the same images the one
    /// with less is nearer to the truth. Squared corrections of attitude and velocity in units of what is expected of them, and the logarithm of what their
    /// noise had to be enlarged by.
    pub(crate) fn contradiction(&self) -> f64 {
        self.contradiction
    }

    /// Factors on the noise densities of gyroscope and accelerometer.
    pub(crate) fn factors(&self) -> [f64; 2] {
        self.log_variance.map(|log| (0.5 * log).exp())
    }
}

/// Covariance of velocity and attitude.
fn blocks(estimator: &Estimator) -> [Matrix3<f64>; 2] {
    [error_state::VELOCITY, error_state::ATTITUDE].map(|row| estimator.covariance.block(row, row))
}

/// `dᵀ G⁻¹ d`; `None` where an image corrected nothing.
fn squared_length((d, gain): &(Vector3<f64>, Matrix3<f64>)) -> Option<f64> {
    let length = d.dot(&gain.cholesky()?.solve(d));
    length.is_finite().then_some(length)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::Rng;

    /// Squared length of three normal numbers of a deviation.
    fn length(rng: &mut Rng, deviation: f64) -> f64 {
        (rng.normal_vector() * deviation).norm_squared()
    }

    #[test]
    fn corrections_as_expected_leave_the_data_sheet_alone() {
        let (mut rng, mut adaptation) = (Rng::new(5), InnovationAdaptation::default());
        let mut sums = [0.0; 2];
        for _ in 0..2000 {
            let lengths = [Some(length(&mut rng, 1.0)), Some(length(&mut rng, 1.0))];
            adaptation.learn(lengths, 30.0);
            for (sum, factor) in sums.iter_mut().zip(adaptation.factors()) {
                *sum += factor / 2000.0;
            }
        }
        assert!(sums.iter().all(|mean| (1.0..1.1).contains(mean)), "{sums:?}");
    }

    #[test]
    fn corrections_that_are_too_long_widen_the_noise_of_their_sensor_until_they_end() {
        let (mut rng, mut adaptation) = (Rng::new(6), InnovationAdaptation::default());
        for _ in 0..200 {
            let lengths = [Some(length(&mut rng, 1.0)), Some(length(&mut rng, 3.0))];
            adaptation.learn(lengths, 30.0);
        }
        let [gyro, accel] = adaptation.factors();
        assert!(gyro < 1.5 && (accel - 30.0).abs() < 1e-9, "{gyro} {accel}");
        // 2 ln 30 at 0.1 for each image.
        for _ in 0..100 {
            let lengths = [None, Some(length(&mut rng, 1.0))];
            adaptation.learn(lengths, 30.0);
        }
        assert!(adaptation.factors()[1] < 1.5 && adaptation.factors()[0] == gyro, "{adaptation:?}");
        // One image alone, however wrong, does little.
        let mut once = InnovationAdaptation::default();
        once.learn([Some(1e9), None], 30.0);
        assert!(once.factors()[0] < 1.7, "{once:?}");
    }
}
