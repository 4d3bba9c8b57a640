//! The footprint operator of the network, polyphase: one phase of the pixels within a cell after the other.

use super::padded_grid::{BLOCK, PaddedGrid, weighted_sum};
use super::real::Real;

/// The footprint of the nozzle as the network sees it: from the paint of cells to the depth of pixels, scaled so that equal
/// cells give an equal depth (`deposit`), and the mean of pixels under the footprint of a cell (`mean`), which is the adjoint
/// divided by the pixels per cell.
#[derive(Debug, Clone)]
pub(crate) struct FootprintOperator<T> {
    along: Axis<T>,
    down: Axis<T>,
}

/// One direction. Pixel `m·stride + phase` and cell `m + step` are `first + step·stride - phase` pixels apart.
#[derive(Debug, Clone)]
struct Axis<T> {
    stride: usize,
    /// Per phase: `(step + reach, tap)`, taps normalised to the sum 1.
    phases: Vec<Vec<(usize, T)>>,
    reach: usize,
    /// Cells further apart have no pixel in common.
    overlap: usize,
    /// Standard deviation of the profile, in strides.
    deviation: T,
}

impl<T: Real> Axis<T> {
    /// `taps` of odd length; cell 0 sits at pixel `first`.
    fn new(taps: &[f64], stride: usize, first: usize) -> Self {
        let radius = (taps.len() / 2) as i64;
        let total: f64 = taps.iter().sum();
        let (stride_wide, first) = (stride as i64, first as i64);
        let reach = (radius + stride_wide) / stride_wide + 1;
        let phases = (0..stride_wide)
            .map(|phase| {
                (-reach..=reach)
                    .filter_map(|step| {
                        let distance = first + step * stride_wide - phase;
                        (distance.abs() <= radius)
                            .then(|| ((step + reach) as usize, T::of(taps[(distance + radius) as usize] / total)))
                    })
                    .collect()
            })
            .collect();
        let variance: f64 = taps.iter().zip(-radius..).map(|(tap, d)| tap * (d * d) as f64).sum();
        let deviation = T::of((variance / total).sqrt() / stride as f64);
        let overlap = 2 * (taps.len() / 2) / stride;
        Self { stride, phases, reach: reach as usize, overlap, deviation }
    }
}

impl<T: Real> FootprintOperator<T> {
    /// `taps`: profile of the nozzle; `stride` pixels per cell along and down; `first`: pixel of the first cell.
    pub(crate) fn new(taps: &[f64], stride: (usize, usize), first: (usize, usize)) -> Self {
        Self { along: Axis::new(taps, stride.0, first.0), down: Axis::new(taps, stride.1, first.1) }
    }

    /// Margin that grids of cells need.
    pub(crate) fn reach(&self) -> usize {
        self.along.reach.max(self.down.reach)
    }

    /// Two cells further apart than this have no pixel in common.
    pub(crate) fn overlap(&self) -> usize {
        self.along.overlap.max(self.down.overlap)
    }

    /// Rows and columns of pixels per cell.
    pub(crate) fn stride(&self) -> (usize, usize) {
        (self.along.stride, self.down.stride)
    }

    /// Standard deviation of the footprint in cells, less one, along and down.
    pub(crate) fn conditioning(&self) -> [T; 2] {
        [self.along.deviation - T::of(1.0), self.down.deviation - T::of(1.0)]
    }

    /// Length of the scratch that both directions need.
    pub(crate) fn scratch(&self, cells: &PaddedGrid) -> PaddedGrid {
        // One plane per phase; cells with margins in both directions.
        PaddedGrid::new(cells.width + 1, cells.height * self.down.stride + self.down.stride, self.reach())
    }

    /// `pixels = G cells`. The scratch has one plane of `scratch()` per phase along.
    pub(crate) fn deposit(&self, cells: &PaddedGrid, from: &[T], pixels: &PaddedGrid, to: &mut [T], scratch: &mut [T]) {
        let gain = T::of((self.along.stride * self.down.stride) as f64);
        let work = self.scratch(cells);
        let (columns, mut terms) = (cells.width + 1, Vec::with_capacity(2 * self.reach() + 1));
        // Down: rows of pixels, columns of cells.
        for y in 0..pixels.height {
            let (m, phase) = (y / self.down.stride, y % self.down.stride);
            terms.clear();
            terms.extend(self.down.phases[phase].iter().filter_map(|&(step, tap)| {
                let j = (m + step).checked_sub(self.down.reach).filter(|&j| j < cells.height)?;
                Some((cells.at(0, j), gain * tap))
            }));
            let at = work.at(0, y);
            weighted_sum(&mut scratch[at..at + columns.next_multiple_of(BLOCK)], from, &terms);
            scratch[at + cells.width..at + columns.next_multiple_of(BLOCK)].fill(T::default());
        }
        // Along: one phase of the columns after the other.
        let mut line = vec![T::default(); columns.next_multiple_of(BLOCK)];
        for y in 0..pixels.height {
            for (phase, taps) in self.along.phases.iter().enumerate() {
                terms.clear();
                terms.extend(taps.iter().map(|&(step, tap)| (work.at(0, y) + step - self.along.reach, tap)));
                weighted_sum(&mut line, scratch, &terms);
                let row = pixels.row_mut(to, 0, y);
                for (out, &v) in row.iter_mut().skip(phase).step_by(self.along.stride).zip(&line) {
                    *out = v;
                }
            }
        }
    }

    /// `cells = mean of pixels under each footprint`. Pixels outside the picture count as zero.
    pub(crate) fn mean(
        &self,
        cells: &PaddedGrid,
        to: &mut [T],
        plane: usize,
        pixels: &PaddedGrid,
        from: &[T],
        scratch: &mut [T],
    ) {
        let work = self.scratch(cells);
        let mut terms = Vec::with_capacity(2 * self.reach() * self.down.stride.max(self.along.stride));
        let mut line = vec![T::default(); pixels.width.next_multiple_of(BLOCK)];
        for j in 0..cells.height {
            // Down: one row of cells, columns of pixels, sorted by phase into the scratch.
            terms.clear();
            for (phase, taps) in self.down.phases.iter().enumerate() {
                // The cell is `step` after the pixel's own: the pixel is `step` before the cell.
                terms.extend(taps.iter().filter_map(|&(step, tap)| {
                    let m = (j + self.down.reach).checked_sub(step)?;
                    let y = m * self.down.stride + phase;
                    (y < pixels.height).then(|| (pixels.at(0, y), tap))
                }));
            }
            terms.sort_by_key(|t| t.0);
            weighted_sum(&mut line, from, &terms);
            for phase in 0..self.along.stride {
                let at = phase * work.plane() + work.at(0, j);
                let row = &mut scratch[at..=at + cells.width];
                row.fill(T::default());
                let values = line[..pixels.width].iter().skip(phase).step_by(self.along.stride);
                for (out, &v) in row.iter_mut().zip(values) {
                    *out = v;
                }
            }
        }
        for j in 0..cells.height {
            terms.clear();
            for (phase, taps) in self.along.phases.iter().enumerate() {
                let at = phase * work.plane() + work.at(0, j) + self.along.reach;
                terms.extend(taps.iter().map(|&(step, tap)| (at - step, tap)));
            }
            let out = cells.blocks_mut(to, plane, j);
            weighted_sum(out, scratch, &terms);
            cells.clear_tail(to, plane, j);
        }
    }
}
