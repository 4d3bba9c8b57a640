//! Stacks of planes with margins.

use super::real::Real;

/// Values that one inner loop handles: every row of a plane may be read and written in blocks of this many, beyond its end too.
pub(crate) const BLOCK: usize = 16;

/// Where the values of a stack of planes lie: rows of `pitch` values with margins on all sides, so that neighbours of border
/// values can be read. What lies in the margins is zero whenever a neighbour is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct PaddedGrid {
    pub(crate) width: usize,
    pub(crate) height: usize,
    margin: usize,
    pub(crate) pitch: usize,
}

impl PaddedGrid {
    pub(crate) fn new(width: usize, height: usize, margin: usize) -> Self {
        Self { width, height, margin, pitch: width.next_multiple_of(BLOCK) + BLOCK + 2 * margin }
    }

    /// Values in one plane.
    pub(crate) fn plane(&self) -> usize {
        // One block more, for reads past the last row's end.
        self.pitch * (self.height + 2 * self.margin) + BLOCK
    }

    /// Index of column `x`, row `y` in the first plane.
    pub(crate) fn at(&self, x: usize, y: usize) -> usize {
        (y + self.margin) * self.pitch + self.margin + x
    }

    /// Zeroed planes.
    pub(crate) fn planes<T: Real>(&self, count: usize) -> Vec<T> {
        vec![T::default(); count * self.plane()]
    }

    /// The values of row `y` of plane `k`.
    pub(crate) fn row<'a, T>(&self, planes: &'a [T], k: usize, y: usize) -> &'a [T] {
        let at = k * self.plane() + self.at(0, y);
        &planes[at..at + self.width]
    }

    /// The values of row `y` of plane `k`, to be changed.
    pub(crate) fn row_mut<'a, T>(&self, planes: &'a mut [T], k: usize, y: usize) -> &'a mut [T] {
        let at = k * self.plane() + self.at(0, y);
        &mut planes[at..at + self.width]
    }

    /// Row `y` of plane `k` to the end of its last block.
    pub(crate) fn blocks_mut<'a, T>(&self, planes: &'a mut [T], k: usize, y: usize) -> &'a mut [T] {
        let at = k * self.plane() + self.at(0, y);
        &mut planes[at..at + self.width.next_multiple_of(BLOCK)]
    }

    /// Zeroes what a row's last block wrote past its end.
    pub(crate) fn clear_tail<T: Real>(&self, planes: &mut [T], k: usize, y: usize) {
        let width = self.width;
        self.blocks_mut(planes, k, y)[width..].fill(T::default());
    }
}

/// `out[m] = Σ_k tap_k · source[offset_k + m]` over whole blocks.
pub(crate) fn weighted_sum<T: Real>(out: &mut [T], source: &[T], terms: &[(usize, T)]) {
    for (b, out) in out.chunks_exact_mut(BLOCK).enumerate() {
        let mut sum = [T::default(); BLOCK];
        for &(offset, tap) in terms {
            let from = &source[offset + b * BLOCK..][..BLOCK];
            for (s, &v) in sum.iter_mut().zip(from) {
                *s += tap * v;
            }
        }
        out.copy_from_slice(&sum);
    }
}
