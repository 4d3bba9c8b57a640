//! The density of a spray over points that are given by three linear forms: written so that
//! a loop over points becomes vector code.

use std::array::from_fn;

use nalgebra::Vector3;

/// Coefficients of `exp`, by Taylor's series: within 3e-10 from `-ln(2)/2` to `ln(2)/2`.
pub(crate) const EXP: [f64; 9] =
    [1.0, 1.0, 0.5, 1.0 / 6.0, 1.0 / 24.0, 1.0 / 120.0, 1.0 / 720.0, 1.0 / 5040.0, 1.0 / 40320.0];
/// A sum with it is rounded to a whole number, which stands in its last bits.
pub(crate) const ROUNDING: f64 = 6_755_399_441_055_744.0;
/// Smaller exponents give nothing that counts, and no number that is normal.
pub(crate) const LEAST_EXPONENT: f64 = -700.0;

/// A spray's cone by the distances of a point along its axis and along both sides of its ellipse, these in deviations.
pub(crate) struct SlopeForms {
    /// Axis, and the sides over their deviations.
    pub(super) forms: [Vector3<f64>; 3],
    /// Slopes of the middle along the sides, in deviations.
    pub(super) center: [f64; 2],
    /// Square of the cut.
    pub(super) most: f64,
    pub(super) range: f64,
    /// Share that lands per solid angle of slopes, over the Gaussian's own.
    pub(super) scale: f64,
}

impl SlopeForms {
    /// The three forms of a vector.
    #[inline(always)]
    pub(crate) fn of(&self, vector: &Vector3<f64>) -> [f64; 3] {
        from_fn(|k| self.forms[k].dot(vector))
    }

    /// Paint per area and unit volume, over the distance of the point's plane from the nozzle, at a point given by its forms.
    #[inline(always)]
    pub(crate) fn density(&self, [depth, left, up]: &[f64; 3]) -> f64 {
        let inverse = 1.0 / depth;
        let (a, b) = (left * inverse - self.center[0], up * inverse - self.center[1]);
        let square = a * a + b * b;
        let density = self.scale * exp(-0.5 * square) * (inverse * inverse * inverse);
        let before = *depth > 0.0 && *depth <= self.range;
        if before && square <= self.most { density } else { 0.0 }
    }
}

/// The exponential of a number that is not positive, within 3e-10 of itself: without a branch, and without a call.
#[inline(always)]
fn exp(power: f64) -> f64 {
    let power = if power > LEAST_EXPONENT { power } else { LEAST_EXPONENT };
    let whole = power * std::f64::consts::LOG2_E + ROUNDING;
    let part = power - (whole - ROUNDING) * std::f64::consts::LN_2;
    let [c0, c1, c2, c3, c4, c5, c6, c7, c8] = EXP;
    let (low, high) = (part * part, (part * part) * (part * part));
    let series =
        ((c0 + c1 * part) + low * (c2 + c3 * part)) + high * (((c4 + c5 * part) + low * (c6 + c7 * part)) + high * c8);
    series * f64::from_bits((whole.to_bits() << 52).wrapping_add(1.0_f64.to_bits()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_exponential_is_that_of_the_library() {
        for k in 0..70_000 {
            let power = -0.01 * f64::from(k);
            let found = exp(power);
            assert!((found / power.exp() - 1.0).abs() < 3e-10, "{power}: {found}");
        }
        assert!([-1e9, f64::NEG_INFINITY, f64::NAN].into_iter().all(|power| (0.0..1e-300).contains(&exp(power))));
    }
}
