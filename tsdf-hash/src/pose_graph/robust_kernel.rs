//! Robust kernels: what a factor costs that contradicts the others.

/// A robust kernel `ρ`, a function of `χ²`, the squared residual in units of its covariance. Where it is not robust, `ρ = χ²`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum RobustKernel {
    /// `ρ = χ²`.
    #[default]
    Squared,
    /// Grows linearly from `χ = k` on (Huber 1964): `ρ = 2 k χ − k²`.
    Huber(f64),
    /// Grows logarithmically: `ρ = k² ln(1 + χ²/k²)`.
    Cauchy(f64),
    /// Dynamic covariance scaling (Agarwal et al. 2013): from `χ² = φ` on the information is scaled by `s² = (2 φ / (φ + χ²))²`,
    /// which makes `ρ = φ (3 χ² − φ) / (φ + χ²)`: never more than `3 φ`, so that a false loop lets go.
    DynamicCovarianceScaling(f64),
}

impl RobustKernel {
    /// `ρ(χ²)`, and its derivative, which is the weight of the factor.
    pub fn evaluate(self, chi_squared: f64) -> (f64, f64) {
        let x = chi_squared;
        match self {
            Self::Huber(k) if x > k * k => {
                let chi = x.sqrt();
                (2.0 * k * chi - k * k, k / chi)
            }
            Self::Cauchy(k) => (k * k * (x / (k * k)).ln_1p(), 1.0 / (1.0 + x / (k * k))),
            Self::DynamicCovarianceScaling(phi) if x > phi => {
                let scale = 2.0 * phi / (phi + x);
                (phi * (3.0 * x - phi) / (phi + x), scale * scale)
            }
            _ => (x, 1.0),
        }
    }

    /// Whether its constant makes sense.
    pub(crate) fn is_valid(self) -> bool {
        match self {
            Self::Squared => true,
            Self::Huber(k) | Self::Cauchy(k) | Self::DynamicCovarianceScaling(k) => k > 0.0 && k.is_finite(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_are_derivatives_and_kernels_join_smoothly() {
        for kernel in [RobustKernel::Huber(1.3), RobustKernel::Cauchy(0.8), RobustKernel::DynamicCovarianceScaling(2.0)]
        {
            for x in [0.1, 1.69, 2.0, 5.0, 100.0] {
                let h = 1e-6;
                let slope = (kernel.evaluate(x + h).0 - kernel.evaluate(x - h).0) / (2.0 * h);
                assert!((slope - kernel.evaluate(x).1).abs() < 1e-5, "{kernel:?} {x}");
            }
            assert!((kernel.evaluate(1e-9).0 - 1e-9).abs() < 1e-15);
        }
        assert!(RobustKernel::DynamicCovarianceScaling(2.0).evaluate(1e12).0 < 6.0);
    }
}
