//! Products of matrices, the one place where training spends its time.

use crate::network::Real;

/// Numbers in one register of the processor that is compiled for. Sums always run in the same order, so the width does not
/// change a bit of the result.
const LANES: usize = if cfg!(target_feature = "avx512f") {
    16
} else if cfg!(target_feature = "avx") {
    8
} else {
    4
};
/// Columns that are worked on at once: two registers.
const WIDTH: usize = 2 * LANES;
/// Most rows that are worked on at once: with `WIDTH` columns they fill the registers.
const ROWS: usize = 6;

/// A matrix cut into panels of `WIDTH` columns, each row by row: the right factor of a product. The last is filled with zeros.
#[derive(Debug, Clone)]
pub(crate) struct Panels<T> {
    rows: usize,
    columns: usize,
    data: Vec<T>,
}

impl<T: Real> Panels<T> {
    /// From rows of `columns` numbers.
    pub(crate) fn new(matrix: &[T], columns: usize) -> Self {
        let rows = matrix.len() / columns;
        let mut data = vec![T::default(); columns.div_ceil(WIDTH) * WIDTH * rows];
        for (panel, first) in data.chunks_exact_mut(WIDTH * rows).zip((0..columns).step_by(WIDTH)) {
            let count = WIDTH.min(columns - first);
            for (to, from) in panel.chunks_exact_mut(WIDTH).zip(matrix.chunks_exact(columns)) {
                to[..count].copy_from_slice(&from[first..first + count]);
            }
        }
        Self { rows, columns, data }
    }

    /// Adds `left · self` to `out`, both row by row.
    pub(crate) fn add_product(&self, left: &[T], out: &mut [T]) {
        let count = left.len() / self.rows;
        let blocks = count.div_ceil(ROWS);
        for (k, panel) in self.data.chunks_exact(WIDTH * self.rows).enumerate() {
            // Blocks of nearly the same height: one of a single row would cost as much as a full one.
            for block in 0..blocks {
                let (from, to) = (block * count / blocks, (block + 1) * count / blocks);
                let left = &left[from * self.rows..to * self.rows];
                let out = &mut out[from * self.columns..to * self.columns];
                match to - from {
                    1 => self.block::<1>(panel, k * WIDTH, left, out),
                    2 => self.block::<2>(panel, k * WIDTH, left, out),
                    3 => self.block::<3>(panel, k * WIDTH, left, out),
                    4 => self.block::<4>(panel, k * WIDTH, left, out),
                    5 => self.block::<5>(panel, k * WIDTH, left, out),
                    _ => self.block::<6>(panel, k * WIDTH, left, out),
                }
            }
        }
    }

    /// `M` rows. Not inlined: six of them in one function are more than the compiler keeps in registers.
    #[inline(never)]
    fn block<const M: usize>(&self, panel: &[T], first: usize, left: &[T], out: &mut [T]) {
        let rows: [&[T]; M] = std::array::from_fn(|m| &left[m * self.rows..(m + 1) * self.rows]);
        let mut sums = [[[T::default(); LANES]; 2]; M];
        for (k, right) in panel.as_chunks::<LANES>().0.as_chunks::<2>().0.iter().enumerate() {
            // Whole arrays by index: this is the form that stays in registers.
            for m in 0..M {
                let a = rows[m][k];
                for half in 0..2 {
                    for lane in 0..LANES {
                        sums[m][half][lane] = a.fused(right[half][lane], sums[m][half][lane]);
                    }
                }
            }
        }
        let end = self.columns.min(first + WIDTH);
        for (out, sums) in out.chunks_exact_mut(self.columns).zip(&sums) {
            for (out, &sum) in out[first..end].iter_mut().zip(sums.as_flattened()) {
                *out += sum;
            }
        }
    }
}

#[cfg(any(test, feature = "train"))]
/// Side of the squares that are turned one by one: one side of the copy always jumps by rows.
const SQUARE: usize = 16;

#[cfg(any(test, feature = "train"))]
/// Activations as columns.
pub(crate) fn transposed<T: Real>(matrix: &[T], columns: usize) -> Vec<T> {
    let rows = matrix.len() / columns;
    let mut out = vec![T::default(); matrix.len()];
    for top in (0..rows).step_by(SQUARE) {
        for left in (0..columns).step_by(SQUARE) {
            for i in top..rows.min(top + SQUARE) {
                for j in left..columns.min(left + SQUARE) {
                    out[j * rows + i] = matrix[i * columns + j];
                }
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::procedural::lattice;

    #[test]
    fn products_are_sums_over_the_middle() {
        for (count, middle, columns) in [(1, 1, 1), (7, 5, 3), (25, 19, 40), (13, 33, 16), (6, 2, 65)] {
            let draw = |seed, n: usize| -> Vec<f64> { (0..n).map(|k| lattice(seed, k as i64, 1) - 0.5).collect() };
            let (a, b) = (draw(1, count * middle), draw(2, middle * columns));
            let mut out = draw(3, count * columns);
            let before = out.clone();
            Panels::new(&b, columns).add_product(&a, &mut out);
            let across = transposed(&b, columns);
            for i in 0..count {
                for j in 0..columns {
                    let sum: f64 = (0..middle).map(|k| a[i * middle + k] * b[k * columns + j]).sum();
                    assert!((out[i * columns + j] - before[i * columns + j] - sum).abs() < 1e-13);
                    assert!((0..middle).all(|k| across[j * middle + k] == b[k * columns + j]));
                }
            }
        }
    }
}
