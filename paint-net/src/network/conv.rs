//! 3x3 convolutions over stacks of planes, zero outside, with their adjoints.
//!
//! Every output is summed in the same order (input channel, row, column), wherever in a block it falls: a picture painted in
//! tiles is the same to the last bit.

use super::planes::{BLOCK, Grid};
use super::real::Real;

/// Taps of one kernel.
const TAPS: usize = 9;
/// Output channels per inner loop: as many sums as fit the registers.
const LANES: usize = if cfg!(target_feature = "avx") { 4 } else { 2 };

/// Weights ordered for the inner loop: per group of outputs, per input channel, per tap, one weight for each output of the
/// group (zero for outputs that do not exist).
#[derive(Debug, Clone)]
pub(crate) struct Packed<T> {
    ins: usize,
    outs: usize,
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
        let lanes = LANES.min(outs);
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
        Self { ins, outs, weights: packed }
    }

    /// `output = conv(input) + start`, where `start` is the output itself or the bias; negative results become zero with
    /// `rectify`. Output values past the end of a row are zeroed.
    pub(crate) fn apply(&self, grid: &Grid, input: &[T], output: &mut [T], start: Start<T>, rectify: bool) {
        // One output alone must not pay for a group.
        if self.outs == 1 {
            self.groups::<1>(grid, input, output, start, rectify);
        } else {
            self.groups::<LANES>(grid, input, output, start, rectify);
        }
    }

    fn groups<const N: usize>(&self, grid: &Grid, input: &[T], output: &mut [T], start: Start<T>, rectify: bool) {
        let plane = grid.plane();
        for (group, weights) in self.weights.chunks_exact(self.ins * TAPS * N).enumerate() {
            let first = group * N;
            let count = N.min(self.outs - first);
            for y in 0..grid.height {
                for x in (0..grid.width).step_by(BLOCK) {
                    let at = grid.at(x, y);
                    let mut sums = [[T::default(); BLOCK]; N];
                    for (o, sum) in sums.iter_mut().enumerate().take(count) {
                        match start {
                            Start::Bias(bias) => sum.fill(bias[first + o]),
                            Start::Output => sum.copy_from_slice(&output[(first + o) * plane + at..][..BLOCK]),
                        }
                    }
                    sums = accumulate(sums, &input[at - grid.pitch - 1..], plane, grid.pitch, weights);
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

/// The inner loop: `input` begins at the upper left neighbour of the block.
#[inline(always)]
fn accumulate<T: Real, const N: usize>(
    mut sums: [[T; BLOCK]; N],
    input: &[T],
    plane: usize,
    pitch: usize,
    weights: &[T],
) -> [[T; BLOCK]; N] {
    for (channel, weights) in weights.chunks_exact(TAPS * N).enumerate() {
        let from = &input[channel * plane..][..2 * pitch + BLOCK + 2];
        for row in 0..3 {
            let from = &from[row * pitch..][..BLOCK + 2];
            for column in 0..3 {
                let from: &[T] = &from[column..column + BLOCK];
                let weights = &weights[(row * 3 + column) * N..][..N];
                for o in 0..N {
                    for l in 0..BLOCK {
                        sums[o][l] += weights[o] * from[l];
                    }
                }
            }
        }
    }
    sums
}

/// Values per sum of the derivative by a weight.
#[cfg(any(test, feature = "train"))]
const WIDE: usize = 8;

/// Adds to `gradient` (`[out][in][3][3]`) the derivative of a convolution by its weights: `Σ_p up_o(p) input_i(p + tap)`.
/// `up` is zero past the ends of rows.
#[cfg(any(test, feature = "train"))]
pub(crate) fn weights_gradient<T: Real>(
    grid: &Grid,
    (input, ins): (&[T], usize),
    (up, outs): (&[T], usize),
    gradient: &mut [T],
) {
    let plane = grid.plane();
    for first in (0..outs).step_by(2) {
        // An odd last output is computed twice; the second is not used.
        let second = (first + 1).min(outs - 1);
        for i in 0..ins {
            for row in 0..3 {
                let mut sums = [[[T::default(); WIDE]; 3]; 2];
                for y in 0..grid.height {
                    let at = grid.at(0, y);
                    let length = grid.width.next_multiple_of(WIDE);
                    let ups = [&up[first * plane + at..][..length], &up[second * plane + at..][..length]];
                    let from = &input[i * plane + at + row * grid.pitch - grid.pitch - 1..][..length + 2];
                    sums = correlate(sums, ups, from);
                }
                for (o, sums) in (first..=second).zip(&sums) {
                    for (column, sum) in sums.iter().enumerate() {
                        let total = sum.iter().fold(T::default(), |total, &s| total + s);
                        gradient[(o * ins + i) * TAPS + row * 3 + column] += total;
                    }
                }
            }
        }
    }
}

/// One row of two outputs against one row of an input, for three columns of the kernel.
#[cfg(any(test, feature = "train"))]
#[inline(always)]
fn correlate<T: Real>(mut sums: [[[T; WIDE]; 3]; 2], ups: [&[T]; 2], from: &[T]) -> [[[T; WIDE]; 3]; 2] {
    for b in (0..ups[0].len()).step_by(WIDE) {
        let (one, two, from) = (&ups[0][b..b + WIDE], &ups[1][b..b + WIDE], &from[b..b + WIDE + 2]);
        for column in 0..3 {
            let from = &from[column..column + WIDE];
            for l in 0..WIDE {
                sums[0][column][l] += one[l] * from[l];
                sums[1][column][l] += two[l] * from[l];
            }
        }
    }
    sums
}
