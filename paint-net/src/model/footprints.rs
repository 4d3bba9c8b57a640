//! The linear map from the volumes of a grid of sprays to paint depth, and its adjoint.

use super::kernel::SprayKernel;

/// Pixels of the cells along an axis of `n` pixels. Grids start half a stride in, so that both borders are equally far from
/// the first cell.
pub(crate) fn cells(n: usize, stride: usize) -> Vec<usize> {
    (((stride.max(1) - 1) / 2).min(n.saturating_sub(1))..n).step_by(stride.max(1)).collect()
}

/// `G`: from the depths of sprays on a regular grid of cells to the canvas, and its adjoint. Cell `(i, j)` sits at column
/// `x0 + i·along`, row `y0 + j·spacing`. Nothing comes in from outside the picture and what leaves it is lost.
pub(crate) struct FootprintMatrix {
    taps: Vec<f64>,
    radius: usize,
    width: usize,
    height: usize,
    pub(crate) columns: Vec<usize>,
    pub(crate) rows: Vec<usize>,
}

impl FootprintMatrix {
    pub(crate) fn new(kernel: &SprayKernel, size: (usize, usize), along: usize, spacing: usize) -> Self {
        let (width, height) = size;
        Self {
            taps: kernel.taps().to_vec(),
            radius: kernel.radius(),
            width,
            height,
            columns: cells(width, along),
            rows: cells(height, spacing),
        }
    }

    pub(crate) fn cells(&self) -> usize {
        self.columns.len() * self.rows.len()
    }

    /// The part of the profile about `centre` that lies within `0..n`: first pixel and taps.
    fn window(&self, centre: usize, n: usize) -> (usize, &[f64]) {
        let first = centre.saturating_sub(self.radius);
        let last = (centre + self.radius).min(n - 1);
        (first, &self.taps[first + self.radius - centre..=last + self.radius - centre])
    }

    /// `canvas += G v`.
    pub(crate) fn deposit(&self, volumes: &[f64], canvas: &mut [f64]) {
        let mut line = vec![0.0; self.width];
        for (j, &row) in self.rows.iter().enumerate() {
            let cells = &volumes[j * self.columns.len()..(j + 1) * self.columns.len()];
            if cells.iter().all(|&v| v == 0.0) {
                continue;
            }
            line.fill(0.0);
            for (&column, &v) in self.columns.iter().zip(cells) {
                if v != 0.0 {
                    let (first, taps) = self.window(column, self.width);
                    for (out, tap) in line[first..].iter_mut().zip(taps) {
                        *out += v * tap;
                    }
                }
            }
            let (first, taps) = self.window(row, self.height);
            for (y, tap) in (first..).zip(taps) {
                let out = &mut canvas[y * self.width..(y + 1) * self.width];
                for (o, l) in out.iter_mut().zip(&line) {
                    *o += tap * l;
                }
            }
        }
    }

    /// `cells = Gᵀ image`.
    pub(crate) fn adjoint(&self, image: &[f64], cells: &mut [f64]) {
        let n = self.columns.len();
        for (j, cells) in cells.chunks_exact_mut(n).enumerate() {
            self.adjoint_row(image, j, 0..n, cells);
        }
    }

    /// The part of `Gᵀ image` in one row of cells, for a range of its columns.
    pub(crate) fn adjoint_row(&self, image: &[f64], row: usize, columns: std::ops::Range<usize>, cells: &mut [f64]) {
        let Some(last) = columns.end.checked_sub(1).filter(|&last| last >= columns.start) else { return };
        let left = self.window(self.columns[columns.start], self.width).0;
        let (right, taps) = self.window(self.columns[last], self.width);
        let right = right + taps.len();
        let mut line = vec![0.0; right - left];
        let (first, taps) = self.window(self.rows[row], self.height);
        for (y, tap) in (first..).zip(taps) {
            for (l, v) in line.iter_mut().zip(&image[y * self.width + left..y * self.width + right]) {
                *l += tap * v;
            }
        }
        for (cell, &column) in cells[columns.clone()].iter_mut().zip(&self.columns[columns]) {
            let (first, taps) = self.window(column, self.width);
            *cell = line[first - left..].iter().zip(taps).map(|(l, t)| l * t).sum();
        }
    }

    /// Adds one spray to the canvas.
    pub(crate) fn deposit_one(&self, cell: usize, volume: f64, canvas: &mut [f64]) {
        let (x0, across) = self.window(self.columns[cell % self.columns.len()], self.width);
        let (y0, down) = self.window(self.rows[cell / self.columns.len()], self.height);
        for (y, tap) in (y0..).zip(down) {
            for (out, t) in canvas[y * self.width + x0..].iter_mut().zip(across) {
                *out += volume * tap * t;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn deposit_and_adjoint_are_adjoint_and_match_the_definition() {
        let kernel = SprayKernel::new(1.7, 2.5).unwrap();
        let g = FootprintMatrix::new(&kernel, (19, 13), 2, 3);
        let noise = |k: usize| ((k * 2_654_435_761) % 1009) as f64 / 1009.0;
        let volumes: Vec<f64> = (0..g.cells()).map(noise).collect();
        let image: Vec<f64> = (0..19 * 13).map(|k| noise(k + 77)).collect();
        let mut canvas = vec![0.0; 19 * 13];
        g.deposit(&volumes, &mut canvas);
        let mut gathered = vec![0.0; g.cells()];
        g.adjoint(&image, &mut gathered);
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
        assert!((dot(&canvas, &image) - dot(&volumes, &gathered)).abs() < 1e-11);
        for y in 0..13_usize {
            for x in 0..19_usize {
                let mut depth = 0.0;
                for (j, &row) in g.rows.iter().enumerate() {
                    for (i, &column) in g.columns.iter().enumerate() {
                        let (dx, dy) = (x.abs_diff(column), y.abs_diff(row));
                        if dx <= 4 && dy <= 4 {
                            let v = volumes[j * g.columns.len() + i];
                            depth += v * (-((dx * dx + dy * dy) as f64) / (2.0 * 1.7 * 1.7)).exp();
                        }
                    }
                }
                assert!((canvas[y * 19 + x] - depth).abs() < 1e-12);
            }
        }
    }
}
