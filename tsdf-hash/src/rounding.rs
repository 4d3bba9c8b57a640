//! Rounding and comparison of single-precision floats that stay in vector registers.

/// `1.5 2^23`: adding it rounds a float to an integer, to even at a tie, and leaves the integer in the low bits.
pub(crate) const ROUNDER: f32 = 12_582_912.0;

/// The nearest integer, to even at a tie, of a float below `2^22` in magnitude.
#[inline(always)]
pub(crate) fn rounded(x: f32) -> i32 {
    (x + ROUNDER).to_bits().wrapping_sub(ROUNDER.to_bits()).cast_signed()
}

/// The first if it is larger, else the second: also if one is NaN, as the vector instructions have it.
#[inline(always)]
pub(crate) fn max(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// The first if it is smaller, else the second: also if one is NaN.
#[inline(always)]
pub(crate) fn min(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[cfg(test)]
mod tests {
    use super::{ROUNDER, rounded};

    #[test]
    fn rounding_is_to_even_at_a_tie() {
        for x in [0.5_f32, 1.5, 2.5, -0.5, -1.5, 7.49, -7.51, 32766.5, -32767.0] {
            assert_eq!((x + ROUNDER) - ROUNDER, x.round_ties_even());
            assert_eq!(rounded(x), x.round_ties_even() as i32);
        }
    }
}
