//! The decision to paint on: a relaxed coin (concrete distribution, Maddison et al. 2017, temperature 1).

#[cfg(any(test, feature = "train"))]
use super::nonlinearities::{sigmoid, softplus};
use crate::network::Real;

/// The sample `z = l + ln u - ln(1 - u)`, given its noise `ln u - ln(1 - u)`.
pub(crate) fn sample<T: Real>(logit: T, noise: T) -> T {
    logit + noise
}

#[cfg(any(test, feature = "train"))]
/// One sample of `ln q(z) - ln p(z)`, both of the form `ln q(z) = -z + l - 2 ln(1 + e^(l - z))`; it may be negative.
pub(crate) fn divergence<T: Real>(sample: T, logit: T, prior: T) -> T {
    let density = |l: T| -sample + l - T::of(2.0) * softplus(l - sample);
    density(logit) - density(prior)
}

#[cfg(any(test, feature = "train"))]
/// Derivative of the divergence by the logit, the sample moving with it: `ln q` of the sample does not change at all.
pub(crate) fn divergence_slope<T: Real>(sample: T, prior: T) -> T {
    T::of(1.0) - T::of(2.0) * sigmoid(prior - sample)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sample_and_divergence_are_those_of_the_reference() {
        let u = 0.3_f64;
        let z = sample(0.4, u.ln() - (1.0 - u).ln());
        assert!((z - -0.447297860387).abs() < 1e-12 && (sigmoid(z) - 0.390003415692).abs() < 1e-12);
        assert!((divergence(z, 0.4, -0.5) - -0.17365908861).abs() < 1e-11);
    }
}
