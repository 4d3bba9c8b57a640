//! How far apart rows of sprays may lie.

use crate::model::SprayKernel;

/// Places between two rows at which their sum is looked at.
const PLACES: usize = 64;
/// Spacings tried, in deviations: from the widest down.
const WIDEST: f64 = 4.0;
const STEP: f64 = 0.01;

/// The widest spacing of rows of equal sprays, pixels, at which the sum of neighbouring profiles has no more than this standard
/// deviation over its mean.
pub(super) fn row_spacing(kernel: &SprayKernel, largest_ripple: f64) -> f64 {
    let steps = (WIDEST / STEP) as usize;
    let spacings = (1..=steps).rev().map(|k| k as f64 * STEP * kernel.sigma());
    spacings.into_iter().find(|&spacing| ripple(kernel, spacing) <= largest_ripple).unwrap_or(STEP * kernel.sigma())
}

/// Standard deviation over mean of the sum of profiles.
fn ripple(kernel: &SprayKernel, spacing: f64) -> f64 {
    let reach = kernel.cut() * kernel.sigma();
    let rows = (reach / spacing).ceil() as i64 + 1;
    let profile = |x: f64| if x.abs() <= reach { (-0.5 * (x / kernel.sigma()).powi(2)).exp() } else { 0.0 };
    let sum = |x: f64| (-rows..=rows).map(|row| profile(x - row as f64 * spacing)).sum::<f64>();
    let sums: Vec<f64> = (0..PLACES).map(|k| sum((k as f64 + 0.5) / PLACES as f64 * spacing)).collect();
    let mean = sums.iter().sum::<f64>() / PLACES as f64;
    (sums.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / PLACES as f64).sqrt() / mean
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Poisson's summation formula: the sum of Gaussians at spacing `s` is a constant with a wave of relative amplitude
    /// `2 exp(-2 π² σ² / s²)`, higher harmonics aside.
    #[test]
    fn the_spacing_is_that_of_the_first_harmonic() {
        let kernel = SprayKernel::new(2.0, 5.0).unwrap();
        for ripple in [0.002, 0.01, 0.05, 0.2] {
            let expected = 2.0 * (2.0 * std::f64::consts::PI.powi(2) / (std::f64::consts::SQRT_2 / ripple).ln()).sqrt();
            let found = row_spacing(&kernel, ripple);
            assert!((found / expected - 1.0).abs() < 0.01, "{found} for {expected}");
        }
    }
}
