//! Plane fits over windows of 7 x 7 pixels, row by row: inverse depth, its edges, its slopes and its mean.
//!
//! Rows pass through rings of a few lines, so that the whole pipeline stays in the cache. All of it is plain `+ - * /` in
//! a fixed order.

use crate::images::{DepthData, DepthView};
use crate::integration::gap_filling::GapFilling;
use crate::integration::inverse_depth_noise::InverseDepthNoise;
use crate::settings::Settings;

/// Half the window of the fit: 7 x 7 pixels (ours; the noise of a pixel of a plane shrinks to a seventh, and the error
/// of a normal at 2 m is about 6 degrees).
const RADIUS: usize = 3;
/// Pixels of context on each side of a row: the window, one for the edge test, and one for the filling of gaps.
pub(crate) const HALO: usize = RADIUS + 2;
/// Lines in a ring: from the first line of a window to the one that its last gap needs.
const RING: usize = 2 * HALO;
/// Values in the window.
pub(crate) const COUNT: f32 = 49.0;
/// `Σ i²` over the window.
pub(crate) const SPREAD: f32 = 196.0;
/// Of the rim, 28 values, and of the middle, 21: `84 (rim / 28 - middle / 21)` has integer factors.
pub(crate) const BENDING: f32 = 84.0;
/// Pixels of the window, times the variance of four second differences.
pub(crate) const ROUGHNESS: f32 = COUNT * 24.0;
/// Variance of the bend, for noise of unit variance.
pub(crate) const BEND_VARIANCE: f32 = 1.0 / 6.0;

/// The last lines of something.
struct Ring([Vec<f32>; RING]);

impl Ring {
    fn new(length: usize) -> Self {
        Self([(); RING].map(|()| vec![f32::NAN; length]))
    }

    fn line(&self, k: usize) -> &[f32] {
        &self.0[k % RING]
    }

    /// Seven lines from `k` on.
    fn seven(&self, k: usize) -> [&[f32]; 7] {
        [0, 1, 2, 3, 4, 5, 6].map(|j| self.line(k + j))
    }

    fn line_mut(&mut self, k: usize) -> &mut Vec<f32> {
        &mut self.0[k % RING]
    }
}

/// Fits around the rows of a band, one row after the other. Line `k` is image row `first + k - HALO`.
pub(crate) struct Windows<'a> {
    depth: &'a DepthView<'a>,
    first: usize,
    near: f32,
    far: f32,
    noise: InverseDepthNoise,
    gaps: GapFilling,
    /// Inverse depth as it was measured, NaN where there is none: arithmetic then spreads the gaps. With a pixel on each side.
    measured: Ring,
    /// The same with gaps filled and with `HALO` pixels on each side.
    raw: Ring,
    /// The same with NaN at edges.
    smooth: Ring,
    /// Along the line, over the window: sum, first moment, second difference.
    total: Ring,
    moment: Ring,
    bend: Ring,
    /// Squared second differences of a line, and their sums along it.
    rough: Vec<f32>,
    roughness: Ring,
    /// Of the row that was asked for: total, slopes, bend and roughness.
    fits: [Vec<f32>; 5],
}

/// A row and its fits; slices of the image's width. The fits are NaN where the window has a gap or an edge.
#[derive(Clone, Copy)]
pub(crate) struct Row<'a> {
    /// Inverse depth as it was measured, NaN where it was not.
    pub(crate) measured: &'a [f32],
    /// Inverse depth of the row above, of the row and of the row below, with one pixel more on each side.
    pub(crate) around: [&'a [f32]; 3],
    /// The same of five rows, with `HALO` pixels more on each side.
    pub(crate) wide: [&'a [f32]; 5],
    /// The row with NaN at edges.
    pub(crate) smooth: &'a [f32],
    /// The mean over the window times [`COUNT`].
    pub(crate) total: &'a [f32],
    /// Slopes per pixel times [`SPREAD`].
    pub(crate) slope: [&'a [f32]; 2],
    /// How far the rim of the window is from its middle, along both axes together, times [`BENDING`]; 0 for a plane.
    pub(crate) bend: &'a [f32],
    /// The mean square of the noise over the window times [`ROUGHNESS`], as far as second differences show it.
    pub(crate) roughness: &'a [f32],
}

impl<'a> Windows<'a> {
    pub(crate) fn new(depth: &'a DepthView<'a>, settings: &Settings, first: usize) -> Self {
        let (width, padded) = (depth.width, depth.width + 2 * HALO);
        let mut windows = Self {
            depth,
            first,
            near: settings.min_depth as f32,
            far: settings.max_depth as f32,
            noise: InverseDepthNoise::new(settings),
            gaps: GapFilling::new(&depth.intrinsics, settings),
            measured: Ring::new(width + 2),
            raw: Ring::new(padded),
            smooth: Ring::new(padded),
            total: Ring::new(width),
            moment: Ring::new(width),
            bend: Ring::new(width),
            rough: vec![0.0; width + 2 * RADIUS],
            roughness: Ring::new(width),
            fits: [(); 5].map(|()| vec![0.0; width]),
        };
        (0..RING).for_each(|k| windows.push(k));
        windows
    }

    /// The row `row` of the band; they are asked for in order.
    #[inline(always)]
    pub(crate) fn row(&mut self, row: usize) -> Row<'_> {
        self.push(row + RING);
        let width = self.depth.width;
        let [total, along, down, bend, roughness] = &mut self.fits;
        let first = row + HALO - RADIUS;
        sum_lines(self.total.seven(first), total, down, bend);
        add_lines(self.moment.seven(first), false, along);
        add_lines(self.bend.seven(first), true, bend);
        add_lines(self.roughness.seven(first), false, roughness);
        Row {
            measured: &self.measured.line(row + HALO)[1..][..width],
            wide: [0, 1, 2, 3, 4].map(|k| self.raw.line(row + HALO - 2 + k)),
            around: [HALO - 1, HALO, HALO + 1].map(|k| &self.raw.line(row + k)[HALO - 1..][..width + 2]),
            smooth: &self.smooth.line(row + HALO)[HALO..][..width],
            total,
            slope: [along, down],
            bend,
            roughness,
        }
    }

    /// Reads line `k`, fills the gaps of the line before it, and finishes the one before that.
    #[inline(always)]
    fn push(&mut self, k: usize) {
        self.read(k);
        let width = self.depth.width;
        self.gaps.along(self.measured.line(k), &mut self.raw.line_mut(k)[HALO..][..width]);
        if k < 2 {
            return;
        }
        let mut filled = std::mem::take(self.raw.line_mut(k - 1));
        let beside = [k - 2, k].map(|k| &self.raw.line(k)[HALO..][..width]);
        self.gaps.across(beside, &mut filled[HALO..][..width]);
        *self.raw.line_mut(k - 1) = filled;
        if k < 3 {
            return;
        }
        let line = k - 2;
        let around = [k - 3, k - 2, k - 1].map(|k| &self.raw.line(k)[HALO - RADIUS - 1..][..width + 2 * RADIUS + 2]);
        let smooth = &mut self.smooth.line_mut(line)[HALO - RADIUS..][..width + 2 * RADIUS];
        smooth_line(around, self.noise, smooth, &mut self.rough);
        sum_line(smooth, self.total.line_mut(line), self.moment.line_mut(line), self.bend.line_mut(line));
        add_line(&self.rough, self.roughness.line_mut(line));
    }

    #[inline(always)]
    fn read(&mut self, k: usize) {
        let width = self.depth.width;
        let (near, far) = (self.near, self.far);
        let out = &mut self.measured.line_mut(k)[1..][..width];
        let Some(v) = (self.first + k).checked_sub(HALO).filter(|&v| v < self.depth.height) else {
            return out.fill(f32::NAN);
        };
        let invert = |z: f32| if z >= near && z <= far { 1.0 / z } else { f32::NAN };
        match self.depth.data {
            DepthData::U16 { data, scale } => {
                let metres = (1.0 / scale) as f32;
                for (out, &d) in out.iter_mut().zip(&data[v * width..][..width]) {
                    *out = if d == u16::MAX { f32::NAN } else { invert(f32::from(d) * metres) };
                }
            }
            DepthData::F32 { data } => {
                for (out, &z) in out.iter_mut().zip(&data[v * width..][..width]) {
                    *out = invert(z);
                }
            }
        }
    }
}

/// A copy of a line with NaN where the 3x3 patch has a gap, or bends or jumps by more than four standard deviations of
/// its noise; and the sum of its squared second differences, which is 24 times the variance of noise on a plane.
#[inline(always)]
fn smooth_line(around: [&[f32]; 3], noise: InverseDepthNoise, out: &mut [f32], rough: &mut [f32]) {
    let width = out.len();
    let rough = &mut rough[..width];
    let [above, here, below] = around.map(|line| &line[..width + 2]);
    for u in 0..width {
        let omega = here[u + 1];
        let second = |a: f32, b: f32| (a + b - 2.0 * omega) * (a + b - 2.0 * omega);
        // One second difference has six times the variance of a pixel. Along an edge of the surface at least two of the
        // four are large. A sum, because it keeps a NaN. Three standard deviations would flag one pixel in a hundred of
        // a noisy plane, and so spoil half of the windows.
        let bend = second(here[u], here[u + 2])
            + second(above[u + 1], below[u + 1])
            + second(above[u], below[u + 2])
            + second(above[u + 2], below[u]);
        let sigma = noise.sigma_inverse(omega);
        rough[u] = bend;
        out[u] = if bend <= 2.0 * 6.0 * 16.0 * sigma * sigma { omega } else { f32::NAN };
    }
}

/// Sum, first moment and second difference of seven neighbours along a line.
#[inline(always)]
fn sum_line(source: &[f32], total: &mut [f32], moment: &mut [f32], bend: &mut [f32]) {
    let width = total.len();
    let (source, moment, bend) = (&source[..width + 6], &mut moment[..width], &mut bend[..width]);
    for u in 0..width {
        let s = &source[u..u + 7];
        (total[u], moment[u], bend[u]) = seven([s[0], s[1], s[2], s[3], s[4], s[5], s[6]]);
    }
}

/// Sum of seven neighbours along a line.
#[inline(always)]
fn add_line(source: &[f32], out: &mut [f32]) {
    let width = out.len();
    let source = &source[..width + 6];
    for u in 0..width {
        let s = &source[u..u + 7];
        out[u] = ((s[0] + s[6]) + (s[1] + s[5])) + ((s[2] + s[4]) + s[3]);
    }
}

/// `Σ x_i`, `Σ i x_i` and `3 Σ_rim x_i - 4 Σ_middle x_i` for `i = -3..=3`.
#[inline(always)]
fn seven(x: [f32; 7]) -> (f32, f32, f32) {
    let (rim, middle) = ((x[0] + x[6]) + (x[1] + x[5]), (x[2] + x[4]) + x[3]);
    let moment = 3.0 * (x[6] - x[0]) + 2.0 * (x[5] - x[1]) + (x[4] - x[2]);
    (rim + middle, moment, 3.0 * rim - 4.0 * middle)
}

/// [`seven`] across lines.
#[inline(always)]
fn sum_lines(lines: [&[f32]; 7], total: &mut [f32], moment: &mut [f32], bend: &mut [f32]) {
    let width = total.len();
    let ([a, b, c, d, e, f, g], moment, bend) =
        (lines.map(|line| &line[..width]), &mut moment[..width], &mut bend[..width]);
    for u in 0..width {
        (total[u], moment[u], bend[u]) = seven([a[u], b[u], c[u], d[u], e[u], f[u], g[u]]);
    }
}

/// Adds seven lines to `out`, or replaces it.
#[inline(always)]
fn add_lines(lines: [&[f32]; 7], keep: bool, out: &mut [f32]) {
    let width = out.len();
    let [a, b, c, d, e, f, g] = lines.map(|line| &line[..width]);
    for u in 0..width {
        let sum = ((a[u] + g[u]) + (b[u] + f[u])) + ((c[u] + e[u]) + d[u]);
        out[u] = if keep { out[u] + sum } else { sum };
    }
}
