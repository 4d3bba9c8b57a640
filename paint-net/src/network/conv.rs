//! 3x3 convolutions over stacks of planes, zero outside, with their adjoints.
//!
//! Every output is summed in the same order (input channel, row, column), wherever in a block it falls: a picture painted in
//! tiles is the same to the last bit.

use super::padded_grid::{BLOCK, PaddedGrid};
use super::real::Real;
use super::widest::{self, Work};

/// Taps of one kernel.
const TAPS: usize = 9;

/// Weights ordered for the inner loop: per group of outputs, per input channel, per tap, one weight for each output of the
/// group (zero for outputs that do not exist).
#[derive(Debug, Clone)]
pub(crate) struct Packed<T> {
    ins: usize,
    outs: usize,
    /// Outputs in a group.
    lanes: usize,
    weights: Vec<T>,
}

impl<T: Real> Packed<T> {
    /// From weights `[out][in][3][3]`.
    pub(crate) fn new(weights: &[T], ins: usize, outs: usize) -> Self {
        Self::gather(ins, outs, |o, i, tap| weights[(o * ins + i) * TAPS + tap])
    }

    /// The adjoint: channels exchanged, kernels turned by half a turn. `weights`, `ins`, `outs` are those of the convolution.
    #[cfg(any(test, feature = "train"))]
    pub(crate) fn adjoint(weights: &[T], ins: usize, outs: usize) -> Self {
        Self::gather(outs, ins, |o, i, tap| weights[(i * ins + o) * TAPS + TAPS - 1 - tap])
    }

    fn gather(ins: usize, outs: usize, weight: impl Fn(usize, usize, usize) -> T) -> Self {
        let lanes = widest::lanes().min(outs);
        let mut packed = Vec::with_capacity(outs.next_multiple_of(lanes) * ins * TAPS);
        for group in (0..outs).step_by(lanes) {
            for i in 0..ins {
                for tap in 0..TAPS {
                    packed.extend(
                        (group..group + lanes).map(|o| if o < outs { weight(o, i, tap) } else { T::default() }),
                    );
                }
            }
        }
        Self { ins, outs, lanes, weights: packed }
    }

    /// `output = conv(input) + start`, where `start` is the output itself or the bias; negative results become zero with
    /// `rectify`. Output values past the end of a row are zeroed.
    pub(crate) fn apply(&self, grid: &PaddedGrid, input: &[T], output: &mut [T], start: Start<T>, rectify: bool) {
        let rows = Rows { packed: self, grid, input, output, start, rectify };
        match self.lanes {
            // One output alone must not pay for a group.
            1 => widest::run(Groups::<T, 1>(rows)),
            2 => widest::run(Groups::<T, 2>(rows)),
            3 => widest::run(Groups::<T, 3>(rows)),
            _ => widest::run(Groups::<T, 4>(rows)),
        }
    }
}

/// What one convolution works on.
struct Rows<'a, T> {
    packed: &'a Packed<T>,
    grid: &'a PaddedGrid,
    input: &'a [T],
    output: &'a mut [T],
    start: Start<'a, T>,
    rectify: bool,
}

/// A convolution by groups of `N` outputs.
struct Groups<'a, T, const N: usize>(Rows<'a, T>);

impl<T: Real, const N: usize> Work for Groups<'_, T, N> {
    #[inline(always)]
    fn run(self) {
        let Rows { packed: Packed { ins, outs, weights, .. }, grid, input, output, start, rectify } = self.0;
        let plane = grid.plane();
        let taps = |channel: usize| (0..TAPS).map(move |tap| channel * plane + tap / 3 * grid.pitch + tap % 3);
        let offsets: Vec<usize> = (0..*ins).flat_map(taps).collect();
        // Rows outside, groups inside: the rows that all groups read stay in the nearest cache.
        for y in 0..grid.height {
            for (group, weights) in weights.chunks_exact(ins * TAPS * N).enumerate() {
                let first = group * N;
                let count = N.min(outs - first);
                for x in (0..grid.width).step_by(BLOCK) {
                    let at = grid.at(x, y);
                    let mut sums = [[T::default(); BLOCK]; N];
                    for (o, sum) in sums.iter_mut().enumerate().take(count) {
                        match start {
                            Start::Bias(bias) => *sum = [bias[first + o]; BLOCK],
                            Start::Output => sum.copy_from_slice(&output[(first + o) * plane + at..][..BLOCK]),
                        }
                    }
                    sums = accumulate(sums, &input[at - grid.pitch - 1..], &offsets, weights);
                    for (o, sum) in sums.iter_mut().enumerate().take(count) {
                        if rectify {
                            for s in sum.iter_mut() {
                                *s = s.at_least(T::default());
                            }
                        }
                        output[(first + o) * plane + at..][..BLOCK].copy_from_slice(sum);
                    }
                }
                for o in first..first + count {
                    grid.clear_tail(output, o, y);
                }
            }
        }
    }
}

/// What the sums of a convolution start from.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Start<'a, T> {
    /// One number per output channel.
    Bias(&'a [T]),
    /// What the output holds.
    Output,
}

/// The inner loop: `input` begins at the upper left neighbour of the block, `offsets` are those of the taps of all channels.
/// One loop over all of them: unrolled by kernel columns, shifted loads would be assembled from registers, of which there are
/// too few.
#[inline(always)]
fn accumulate<T: Real, const N: usize>(
    mut sums: [[T; BLOCK]; N],
    input: &[T],
    offsets: &[usize],
    weights: &[T],
) -> [[T; BLOCK]; N] {
    for (&offset, weights) in offsets.iter().zip(weights.chunks_exact(N)) {
        let from = &input[offset..][..BLOCK];
        for (sum, &weight) in sums.iter_mut().zip(weights) {
            for (s, &v) in sum.iter_mut().zip(from) {
                *s += weight * v;
            }
        }
    }
    sums
}

/// Values per sum of the derivative by a weight, and outputs at a time.
#[cfg(any(test, feature = "train"))]
const WIDE: usize = 8;
#[cfg(any(test, feature = "train"))]
const UPS: usize = 4;

/// Adds to `gradient` (`[out][in][3][3]`) the derivative of a convolution by its weights: `Σ_p up_o(p) input_i(p + tap)`.
/// `up` is zero past the ends of rows.
#[cfg(any(test, feature = "train"))]
pub(crate) fn weights_gradient<T: Real>(
    grid: &PaddedGrid,
    (input, ins): (&[T], usize),
    (up, outs): (&[T], usize),
    gradient: &mut [T],
) {
    let plane = grid.plane();
    let length = grid.width.next_multiple_of(WIDE);
    for first in (0..outs).step_by(UPS) {
        for (i, tap) in (0..ins).flat_map(|i| (0..TAPS).map(move |tap| (i, tap))) {
            let mut sums = [[T::default(); WIDE]; UPS];
            for y in 0..grid.height {
                let at = grid.at(0, y);
                // Outputs that do not exist repeat the last one and are not used.
                let ups = std::array::from_fn(|k| &up[(first + k).min(outs - 1) * plane + at..][..length]);
                let from = &input[i * plane + at + tap / 3 * grid.pitch + tap % 3 - grid.pitch - 1..][..length];
                sums = correlate(sums, ups, from);
            }
            for (o, sum) in (first..outs).zip(&sums) {
                let total = sum.iter().fold(T::default(), |total, &s| total + s);
                gradient[(o * ins + i) * TAPS + tap] += total;
            }
        }
    }
}

/// One row of several outputs against one row of an input.
#[cfg(any(test, feature = "train"))]
#[inline(always)]
fn correlate<T: Real>(mut sums: [[T; WIDE]; UPS], ups: [&[T]; UPS], from: &[T]) -> [[T; WIDE]; UPS] {
    for (b, from) in from.chunks_exact(WIDE).enumerate() {
        for (sum, up) in sums.iter_mut().zip(ups) {
            let up = &up[b * WIDE..][..WIDE];
            for ((s, &u), &v) in sum.iter_mut().zip(up).zip(from) {
                *s += u * v;
            }
        }
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::procedural::lattice;

    /// The same bits with the registers at hand as with the narrow ones, and the sum of the definition.
    #[test]
    fn wide_registers_change_no_bit() {
        let (ins, outs) = (5, 7);
        let number = |seed: u64, k: usize| lattice(seed, k as i64, 1) as f32 - 0.5;
        let weights: Vec<f32> = (0..outs * ins * TAPS).map(|k| number(3, k)).collect();
        let grid = PaddedGrid::new(37, 9, 1);
        let mut input = grid.planes(ins);
        for (plane, y, x) in (0..ins).flat_map(|i| (0..9).flat_map(move |y| (0..37).map(move |x| (i, y, x)))) {
            grid.row_mut(&mut input, plane, y)[x] = number(4, (plane * 9 + y) * 37 + x);
        }
        let packed = Packed::new(&weights, ins, outs);
        let bias: Vec<f32> = (0..outs).map(|o| number(5, o)).collect();
        let (mut wide, mut narrow) = (grid.planes(outs), grid.planes(outs));
        packed.apply(&grid, &input, &mut wide, Start::Bias(&bias), false);
        let start = Start::Bias(&bias[..]);
        let rows = Rows { packed: &packed, grid: &grid, input: &input, output: &mut narrow, start, rectify: false };
        if packed.lanes == 4 {
            Groups::<f32, 4>(rows).run();
        } else {
            Groups::<f32, 2>(rows).run();
        }
        let bits = |planes: &[f32]| planes.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&wide), bits(&narrow));
        let value = |o: usize, y: usize, x: usize| {
            let mut sum = f64::from(bias[o]);
            for (i, tap) in (0..ins).flat_map(|i| (0..TAPS).map(move |tap| (i, tap))) {
                let (dy, dx) = ((y + tap / 3).wrapping_sub(1), (x + tap % 3).wrapping_sub(1));
                if dy < 9 && dx < 37 {
                    sum += f64::from(weights[(o * ins + i) * TAPS + tap]) * f64::from(grid.row(&input, i, dy)[dx]);
                }
            }
            sum
        };
        for (o, y, x) in (0..outs).flat_map(|o| (0..9).flat_map(move |y| (0..37).map(move |x| (o, y, x)))) {
            assert!((f64::from(grid.row(&wide, o, y)[x]) - value(o, y, x)).abs() < 1e-5, "output {o} at {x}, {y}");
        }
    }
}
