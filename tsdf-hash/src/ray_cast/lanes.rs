//! Eight rays side by side.

use crate::ray_cast::cell::{Cell, Y, Z};
use crate::rounding::{ROUNDER, max, min};

/// Rays that are marched together.
pub(crate) const LANES: usize = 8;
/// One number for each of them; loops over all of it become vectors.
pub(crate) type Lanes = [f32; LANES];

#[inline(always)]
pub(crate) fn lanes(of: impl Fn(usize) -> f32) -> Lanes {
    let mut all = [0.0; LANES];
    for (n, value) in all.iter_mut().enumerate() {
        *value = of(n);
    }
    all
}

/// The set of lanes for which something is true, a bit each.
#[inline(always)]
pub(crate) fn flags(of: impl Fn(usize) -> bool) -> u8 {
    (0..LANES).fold(0, |set, n| set | u8::from(of(n)) << n)
}

/// The lanes of a set.
pub(crate) fn set(mut flags: u8) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        (flags != 0).then(|| {
            let first = flags.trailing_zeros() as usize;
            flags &= flags - 1;
            first
        })
    })
}

/// A [`Cell`] for each ray.
pub(crate) struct Cells {
    first: [u32; LANES],
    along: [Lanes; 3],
}

impl Cells {
    /// As [`Cell::at`].
    #[inline(always)]
    pub(crate) fn at(points: [Lanes; 3]) -> Self {
        let mut first = [0; LANES];
        let mut along = [[0.0; LANES]; 3];
        for (k, stride) in [1, Y, Z].into_iter().enumerate() {
            for n in 0..LANES {
                let p = min(max(points[k][n], 0.0), 8.0);
                let shifted = min(p - 0.5, 7.0) + ROUNDER;
                along[k][n] = p - (shifted - ROUNDER);
                first[n] += (shifted.to_bits().wrapping_sub(ROUNDER.to_bits()) & 7) * stride as u32;
            }
        }
        Self { first, along }
    }

    #[inline(always)]
    pub(crate) fn cell(&self, lane: usize) -> Cell {
        Cell { first: self.first[lane] as usize, along: [0, 1, 2].map(|k| self.along[k][lane]) }
    }
}
