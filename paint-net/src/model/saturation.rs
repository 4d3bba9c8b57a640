//! Saturation: how ink grows with paint depth.

use crate::error::{Error, require};

/// Ink above this is out of reach of an asymptotic curve: its depth would be unbounded (cap of the atanh in Paper IV's setting).
const MAX_ASYMPTOTIC_INK: f64 = 0.995;

/// How ink `a` in `[0, 1]` grows with paint depth `c`: `a = f(c)`, `f(0) = 0`, rising.
#[derive(Debug, Clone, PartialEq)]
pub enum Saturation {
    /// `tanh c` (thesis, Paper IV).
    Tanh,
    /// `1 - exp(-density c)`.
    BeerLambert {
        /// Absorbance per unit depth, positive.
        density: f64,
    },
    /// A tabulated curve, for instance sampled from Kubelka-Munk.
    Curve(MonotoneCurve),
}

impl Saturation {
    /// Refuses a density that is none.
    pub(crate) fn check(&self) -> Result<(), Error> {
        match self {
            Self::BeerLambert { density } => {
                require("density", *density, *density > 0.0 && density.is_finite(), "it must be positive and finite")
            }
            Self::Tanh | Self::Curve(_) => Ok(()),
        }
    }

    /// Ink at a depth; depths below zero count as zero.
    #[inline]
    pub fn forward(&self, depth: f64) -> f64 {
        self.forward_and_derivative(depth).0
    }

    /// `f'(c)`.
    #[inline]
    pub fn derivative(&self, depth: f64) -> f64 {
        self.forward_and_derivative(depth).1
    }

    /// [`forward`](Self::forward) and [`derivative`](Self::derivative) at once: what both need is computed once.
    #[inline]
    pub(crate) fn forward_and_derivative(&self, depth: f64) -> (f64, f64) {
        let depth = depth.max(0.0);
        match self {
            Self::Tanh => {
                let ink = depth.tanh();
                (ink, 1.0 - ink.powi(2))
            }
            Self::BeerLambert { density } => (-(-density * depth).exp_m1(), density * (-density * depth).exp()),
            Self::Curve(curve) => curve.value_and_slope(depth),
        }
    }

    /// Depth that gives an ink; what lies above [`Saturation::max_ink`] is clipped to it.
    pub fn inverse(&self, ink: f64) -> f64 {
        let ink = ink.max(0.0).min(self.max_ink());
        match self {
            Self::Tanh => ink.atanh(),
            Self::BeerLambert { density } => -(-ink).ln_1p() / density,
            Self::Curve(curve) => curve.inverse(ink),
        }
    }

    /// Largest ink worth aiming at: 0.995 for an asymptotic curve, the last knot of a curve.
    pub fn max_ink(&self) -> f64 {
        match self {
            Self::Tanh | Self::BeerLambert { .. } => MAX_ASYMPTOTIC_INK,
            Self::Curve(curve) => curve.ink[curve.ink.len() - 1],
        }
    }
}

/// A strictly rising curve through given knots: piecewise cubic, no overshoot (Fritsch and Carlson 1980), flat after the last
/// knot.
#[derive(Debug, Clone, PartialEq)]
pub struct MonotoneCurve {
    depth: Vec<f64>,
    ink: Vec<f64>,
    slope: Vec<f64>,
}

impl MonotoneCurve {
    /// Knots `(depth, ink)`, the first `(0, 0)`, both coordinates strictly rising, ink at most 1.
    pub fn new(knots: &[(f64, f64)]) -> Result<Self, Error> {
        if knots.len() < 2 || knots[0] != (0.0, 0.0) {
            return Err(Error::Curve { index: 0 });
        }
        for (k, pair) in knots.windows(2).enumerate() {
            let ((c0, a0), (c1, a1)) = (pair[0], pair[1]);
            if !(c1 > c0 && a1 > a0 && c1.is_finite() && a1 <= 1.0) {
                return Err(Error::Curve { index: k + 1 });
            }
        }
        let (depth, ink): (Vec<f64>, Vec<f64>) = knots.iter().copied().unzip();
        let secant: Vec<f64> = (1..knots.len()).map(|k| (ink[k] - ink[k - 1]) / (depth[k] - depth[k - 1])).collect();
        let n = knots.len();
        // Slope of the parabola through three knots, at the one on the left of `s0`.
        let three_point = |h0: f64, h1: f64, s0: f64, s1: f64| ((2.0 * h0 + h1) * s0 - h0 * s1) / (h0 + h1);
        let width = |k: usize| depth[k + 1] - depth[k];
        let mut slope = vec![secant[0]; n];
        if n > 2 {
            slope[0] = three_point(width(0), width(1), secant[0], secant[1]).max(0.0);
            slope[n - 1] = three_point(width(n - 2), width(n - 3), secant[n - 2], secant[n - 3]).max(0.0);
        }
        for k in 1..n - 1 {
            let (left, right) = (width(k - 1), width(k));
            slope[k] = (right * secant[k - 1] + left * secant[k]) / (left + right);
        }
        for (k, &s) in secant.iter().enumerate() {
            let (alpha, beta) = (slope[k] / s, slope[k + 1] / s);
            let length = alpha.hypot(beta);
            if length > 3.0 {
                slope[k] = 3.0 * alpha / length * s;
                slope[k + 1] = 3.0 * beta / length * s;
            }
        }
        Ok(Self { depth, ink, slope })
    }

    fn value_and_slope(&self, depth: f64) -> (f64, f64) {
        let n = self.depth.len();
        let k = self.depth.partition_point(|&d| d <= depth);
        if k == n {
            return (self.ink[n - 1], 0.0);
        }
        let k = k.max(1) - 1;
        let h = self.depth[k + 1] - self.depth[k];
        let t = (depth - self.depth[k]) / h;
        let (a0, a1) = (self.ink[k], self.ink[k + 1]);
        let (m0, m1) = (self.slope[k] * h, self.slope[k + 1] * h);
        let rise = a1 - a0;
        // Hermite basis, written as powers of t.
        let (p2, p3) = (3.0 * rise - 2.0 * m0 - m1, m0 + m1 - 2.0 * rise);
        (a0 + t * (m0 + t * (p2 + t * p3)), (m0 + t * (2.0 * p2 + 3.0 * t * p3)) / h)
    }

    /// Bisection inside the knot interval: the curve is monotone there, so 60 halvings are exact to rounding.
    fn inverse(&self, ink: f64) -> f64 {
        let k = self.ink.partition_point(|&a| a < ink);
        if k == 0 {
            return 0.0;
        }
        let (mut low, mut high) = (self.depth[k - 1], self.depth[k.min(self.depth.len() - 1)]);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if self.value_and_slope(middle).0 < ink { low = middle } else { high = middle }
        }
        high
    }
}
