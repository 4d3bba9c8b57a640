//! Inverse depth around a band of rows: its edges, and its slopes over a window.

use super::Noise;
use crate::Settings;
use crate::view::{DepthData, DepthView};

/// Half the window of the slope filter: 7 x 7 pixels (ours; the normal's error at 2 m is then about 6 degrees).
const RADIUS: usize = 3;
/// Pixels of context on each side of a band: the window, and one for the edge test.
pub(super) const HALO: usize = RADIUS + 1;
/// Inverse depth of a band and `HALO` pixels around it, NaN where there is none: arithmetic then spreads the gaps.
pub(super) struct Padded {
    stride: usize,
    values: Vec<f32>,
}

impl Padded {
    pub(super) fn read(depth: &DepthView, settings: &Settings, first: usize, rows: usize) -> Self {
        let stride = depth.width + 2 * HALO;
        let mut values = vec![f32::NAN; stride * (rows + 2 * HALO)];
        let (near, far) = (settings.min_depth as f32, settings.max_depth as f32);
        let invert = |z: f32| if z >= near && z <= far { 1.0 / z } else { f32::NAN };
        for (k, out) in values.chunks_exact_mut(stride).enumerate() {
            let Some(v) = (first + k).checked_sub(HALO).filter(|&v| v < depth.height) else { continue };
            let (row, out) = (v * depth.width..(v + 1) * depth.width, &mut out[HALO..HALO + depth.width]);
            match depth.data {
                DepthData::U16 { data, scale } => {
                    let metres = (1.0 / scale) as f32;
                    for (out, &d) in out.iter_mut().zip(&data[row]) {
                        *out = if d == u16::MAX { f32::NAN } else { invert(f32::from(d) * metres) };
                    }
                }
                DepthData::F32 { data } => {
                    for (out, &z) in out.iter_mut().zip(&data[row]) {
                        *out = invert(z);
                    }
                }
            }
        }
        Self { stride, values }
    }

    /// `length` values of a line, from a column on; both count from the corner of the halo.
    pub(super) fn line(&self, line: usize, column: usize, length: usize) -> &[f32] {
        &self.values[line * self.stride + column..][..length]
    }

    /// A copy with NaN where the 3x3 patch has a gap, or bends or jumps by more than four standard deviations of its
    /// noise.
    pub(super) fn without_edges(&self, noise: &Noise) -> Self {
        let s = self.stride;
        let mut values = vec![f32::NAN; self.values.len()];
        for (k, out) in values.chunks_exact_mut(s).enumerate().skip(1).take(self.values.len() / s - 2) {
            let around = [k - 1, k, k + 1].map(|k| self.line(k, 0, s));
            smooth_line(around, *noise, &mut out[1..s - 1]);
        }
        Self { stride: s, values }
    }
}

fn smooth_line(around: [&[f32]; 3], noise: Noise, out: &mut [f32]) {
    let width = out.len();
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
        out[u] = if bend <= 2.0 * 6.0 * 16.0 * sigma * sigma { omega } else { f32::NAN };
    }
}

/// Least-squares slopes and mean of the inverse depth over the window around each pixel.
pub(super) struct WindowFit {
    /// `Σ i ω`, `Σ j ω` and `Σ ω` over the window, row-major.
    pub(super) sums: [Vec<f32>; 3],
}

impl WindowFit {
    const SIDE: usize = 2 * RADIUS + 1;
    /// One over the number of pixels in the window.
    pub(super) const PER_PIXEL: f32 = 1.0 / (Self::SIDE * Self::SIDE) as f32;
    /// One over `Σ i²` over the window.
    pub(super) const PER_SPREAD: f32 = 3.0 / (Self::SIDE * RADIUS * (RADIUS + 1) * Self::SIDE) as f32;

    pub(super) fn new(smooth: &Padded, rows: usize) -> Self {
        let width = smooth.stride - 2 * HALO;
        let tap = |k: usize| k as f32 - RADIUS as f32;
        let mut along = [vec![0.0; width], vec![0.0; width]];
        let mut sums = [(); 3].map(|()| vec![0.0; width * rows]);
        for line in 0..rows + 2 * RADIUS {
            let source = smooth.line(line + HALO - RADIUS, HALO - RADIUS, width + 2 * RADIUS);
            let [total, moment] = &mut along;
            total.fill(0.0);
            moment.fill(0.0);
            for k in 0..Self::SIDE {
                add_scaled(total, &source[k..], 1.0);
                add_scaled(moment, &source[k..], tap(k));
            }
            for k in 0..Self::SIDE {
                let Some(row) = (line + k).checked_sub(2 * RADIUS).filter(|&row| row < rows) else { continue };
                let out = row * width..(row + 1) * width;
                add_scaled(&mut sums[0][out.clone()], moment, 1.0);
                // This line is the one `RADIUS - k` below the centre.
                add_scaled(&mut sums[1][out.clone()], total, -tap(k));
                add_scaled(&mut sums[2][out], total, 1.0);
            }
        }
        Self { sums }
    }
}

fn add_scaled(out: &mut [f32], values: &[f32], factor: f32) {
    for (out, value) in out.iter_mut().zip(values) {
        *out += factor * value;
    }
}
