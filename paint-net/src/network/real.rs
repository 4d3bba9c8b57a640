//! The real numbers that the networks compute with.

use std::fmt::Debug;
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub};

/// The numbers the network computes with: `f32` to paint and to train, `f64` so that its derivatives can be checked against
/// central differences.
pub(crate) trait Real:
    Copy
    + Debug
    + Default
    + PartialOrd
    + Send
    + Sync
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
{
    /// Nearest number to `value`.
    fn of(value: f64) -> Self;
    /// The same number in double precision.
    fn to_f64(self) -> f64;

    /// The larger of the two; `other` if `self` is no number.
    fn at_least(self, other: Self) -> Self {
        if self > other { self } else { other }
    }

    /// The smaller of the two; `other` if `self` is no number.
    fn at_most(self, other: Self) -> Self {
        if self < other { self } else { other }
    }

    /// `self · factor + term`; rounded once where the processor that is compiled for can, twice elsewhere.
    fn fused(self, factor: Self, term: Self) -> Self;

    /// `eˣ`.
    fn exp(self) -> Self;
}

impl Real for f32 {
    fn of(value: f64) -> Self {
        value as f32
    }

    fn to_f64(self) -> f64 {
        f64::from(self)
    }

    #[inline(always)]
    fn fused(self, factor: Self, term: Self) -> Self {
        if cfg!(target_feature = "fma") { self.mul_add(factor, term) } else { self * factor + term }
    }

    /// Within 2e-7 relative of `eˣ` for `x` in `[-87, 88]`, and at these bounds beyond: without branches or calls, so that
    /// whole rows are computed at once, and the same on every system.
    #[inline(always)]
    fn exp(self) -> Self {
        // Adding it rounds to whole numbers, which then lie in the lowest bits.
        const ROUND: f32 = 12_582_912.0;
        let x = self.at_most(88.0).at_least(-87.0);
        let shifted = x * std::f32::consts::LOG2_E + ROUND;
        let whole = shifted - ROUND;
        // ln 2 in two parts, the first exact in few bits, so that nothing is lost in the difference.
        let r = x - whole * 0.693_359_4 + whole * 2.121_944_4e-4;
        // Taylor: |r| ≤ ½ ln 2, the next term is below 1.2e-8.
        let mut series = 1.0 / 5040.0;
        for factor in [1.0 / 720.0, 1.0 / 120.0, 1.0 / 24.0, 1.0 / 6.0, 0.5, 1.0, 1.0] {
            series = series * r + factor;
        }
        series * f32::from_bits((shifted.to_bits() << 23).wrapping_add(127 << 23))
    }
}

impl Real for f64 {
    fn of(value: f64) -> Self {
        value
    }

    fn to_f64(self) -> f64 {
        self
    }

    fn fused(self, factor: Self, term: Self) -> Self {
        self * factor + term
    }

    fn exp(self) -> Self {
        f64::exp(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fast_exponential_is_the_exponential() {
        let worst = (-8700..=8800).map(|k| {
            let x = k as f32 * 0.01;
            (Real::exp(x).to_f64() / f64::from(x).exp() - 1.0).abs()
        });
        assert!(worst.fold(0.0, f64::max) < 2e-7);
        assert_eq!(Real::exp(0.0_f32), 1.0);
        assert!(Real::exp(1e30_f32).is_finite() && Real::exp(-1e30_f32) > 0.0);
    }
}
