//! From a depth image to one small plane per pixel.
//!
//! For a plane, inverse depth is a linear function of the pixel: `ω(u, v) = ω₀ + a (u - u₀) + b (v - v₀)`, whatever its
//! slope. So slopes come from linear filters, and a depth edge is where second differences of `ω` exceed the noise.

use nalgebra::Isometry3;

use crate::block::MAX_WEIGHT;
use crate::parallel::in_chunks;
use crate::view::{DepthData, DepthView, Intrinsics};
use crate::{Error, Settings, candidates};

/// Half the window of the slope filter: 7 x 7 pixels (ours; the normal's error at 2 m is then about 6 degrees).
const RADIUS: usize = 3;
/// Pixels of context on each side of a band: the window, and one for the edge test.
const HALO: usize = RADIUS + 1;
/// Steeper views of a surface are left to other frames (ours: 84 degrees between ray and normal).
const LEAST_COSINE: f32 = 0.1;

/// The plane seen at a pixel.
#[derive(Clone, Copy, Default)]
pub(crate) struct Plane {
    /// Slopes of the inverse depth, per pixel and metre.
    pub(crate) slope: [f32; 2],
    /// Length of the plane's normal in the form `n · x = 1`, inverted: the distance of the camera from the plane, metres.
    pub(crate) offset: f32,
    /// Weight of the observation, an integer in `1..=15`.
    pub(crate) weight: f32,
}

/// All pixels of a frame, with the blocks near them.
#[derive(Default)]
pub(crate) struct Surface {
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// Inverse depth of the pixels to fuse, 1/m, row-major; 0 for the others and in one extra entry at the end.
    pub(crate) inverse_depth: Vec<f32>,
    pub(crate) planes: Vec<Plane>,
    /// Pixels with a depth in the range.
    pub(crate) valid: usize,
    /// Those of them that are fused.
    pub(crate) fused: usize,
    /// Words of the blocks that may hold a voxel within `μ` of a fused pixel, ascending.
    pub(crate) keys: Vec<crate::key::Key>,
}

/// Rows `first..` of the output, as many as the slices hold.
struct Band<'a> {
    first: usize,
    inverse_depth: &'a mut [f32],
    planes: &'a mut [Plane],
}

impl Surface {
    /// Reads a frame, keeping the buffers of the last one.
    pub(crate) fn read(
        &mut self,
        depth: &DepthView,
        world_from_camera: &Isometry3<f64>,
        settings: &Settings,
    ) -> Result<(), Error> {
        let (width, height) = (depth.width, depth.height);
        (self.width, self.height) = (width, height);
        self.inverse_depth.resize(width * height + 1, 0.0);
        self.inverse_depth[width * height] = 0.0;
        self.planes.resize(width * height, Plane::default());
        // Whole tiles of the candidate search, so that each band can look for its own blocks.
        let rows = height.div_ceil(settings.threads).next_multiple_of(candidates::TILE);
        let inverse_depth = self.inverse_depth[..width * height].chunks_mut(rows * width);
        let mut bands: Vec<Band> = inverse_depth
            .zip(self.planes.chunks_mut(rows * width))
            .enumerate()
            .map(|(k, (inverse_depth, planes))| Band { first: k * rows, inverse_depth, planes })
            .collect();
        let found = in_chunks(&mut bands, settings.threads, |bands| {
            let mut all = (0, 0, Ok(Vec::new()));
            for band in bands {
                let (valid, fused) = band.fill(depth, settings);
                let keys = candidates::near(band.first, band.inverse_depth, depth, world_from_camera, settings);
                all = (all.0 + valid, all.1 + fused, keys);
            }
            all
        });
        (self.valid, self.fused) = (0, 0);
        self.keys.clear();
        for (valid, fused, keys) in found {
            self.valid += valid;
            self.fused += fused;
            self.keys.extend(keys?);
        }
        self.keys.sort_unstable();
        self.keys.dedup();
        if self.fused == 0 { Err(Error::NoDepth { valid: self.valid }) } else { Ok(()) }
    }
}

impl Band<'_> {
    /// Returns how many pixels of the band have a depth in the range and how many of them are fused.
    fn fill(&mut self, depth: &DepthView, settings: &Settings) -> (usize, usize) {
        let width = depth.width;
        let rows = self.inverse_depth.len() / width;
        let noise = Noise::new(settings);
        let raw = Padded::read(depth, settings, self.first, rows);
        let smooth = raw.without_edges(&noise);
        let fit = WindowFit::new(&smooth, rows);
        let (mut valid, mut fused) = (0, 0);
        for row in 0..rows {
            for u in 0..width {
                let at = row * width + u;
                let centre = raw.at(row, u);
                valid += usize::from(!centre.is_nan());
                self.inverse_depth[at] = 0.0;
                if smooth.at(row, u).is_nan() {
                    continue;
                }
                let slope = fit.slope(at, centre, &noise).unwrap_or_else(|| raw.central_slope(row, u));
                if let Some(plane) = plane(&depth.intrinsics, u, self.first + row, centre, slope, &noise) {
                    self.inverse_depth[at] = centre;
                    self.planes[at] = plane;
                    fused += 1;
                }
            }
        }
        (valid, fused)
    }
}

/// The plane through the pixel's own depth with the slopes of its neighbourhood; `None` where it is seen too steeply.
fn plane(k: &Intrinsics, u: usize, v: usize, omega: f32, slope: [f32; 2], noise: &Noise) -> Option<Plane> {
    let (du, dv) = ((u as f64 - k.cx) as f32, (v as f64 - k.cy) as f32);
    // With x = z (du / fx, dv / fy, 1), the plane is n · x = 1.
    let n = [k.fx as f32 * slope[0], k.fy as f32 * slope[1], omega - slope[0] * du - slope[1] * dv];
    let length = (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt();
    let ray = [du / k.fx as f32, dv / k.fy as f32];
    let cosine = omega / (length * (ray[0] * ray[0] + ray[1] * ray[1] + 1.0).sqrt());
    if cosine.is_nan() || cosine < LEAST_COSINE {
        return None;
    }
    let ratio = noise.least / noise.sigma(1.0 / omega);
    let weight = (MAX_WEIGHT * ratio * ratio * cosine).round().clamp(1.0, MAX_WEIGHT);
    Some(Plane { slope, offset: 1.0 / length, weight })
}

/// The noise model in the working precision.
struct Noise {
    base: f32,
    quadratic: f32,
    nearest: f32,
    least: f32,
}

impl Noise {
    fn new(settings: &Settings) -> Self {
        let n = &settings.noise;
        let base = n.base as f32;
        Self { base, quadratic: n.quadratic as f32, nearest: n.nearest as f32, least: base }
    }

    fn sigma(&self, z: f32) -> f32 {
        self.base + self.quadratic * (z - self.nearest) * (z - self.nearest)
    }

    /// Standard deviation of the inverse depth, 1/m.
    fn sigma_inverse(&self, omega: f32) -> f32 {
        self.sigma(1.0 / omega) * omega * omega
    }
}

/// Inverse depth of a band and `HALO` pixels around it, NaN where there is none: arithmetic then spreads the gaps.
struct Padded {
    stride: usize,
    values: Vec<f32>,
}

impl Padded {
    fn read(depth: &DepthView, settings: &Settings, first: usize, rows: usize) -> Self {
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

    fn at(&self, row: usize, u: usize) -> f32 {
        self.values[(row + HALO) * self.stride + u + HALO]
    }

    /// A copy with NaN where the 3x3 patch has a gap or jumps by more than three standard deviations of its noise.
    fn without_edges(&self, noise: &Noise) -> Self {
        let s = self.stride;
        let mut values = vec![f32::NAN; self.values.len()];
        let inner = s + 1..self.values.len() - s - 1;
        // The second difference of three independent values has √6 times the noise of one.
        let limit = 3.0 * 6.0_f32.sqrt();
        for at in inner {
            let w = &self.values[at - s - 1..at + s + 2];
            let twice = 2.0 * w[s + 1];
            let allowed = limit * noise.sigma_inverse(w[s + 1]);
            let small = |step: usize| (w[s + 1 - step] + w[s + 1 + step] - twice).abs() <= allowed;
            if small(1) & small(s) & small(s + 1) & small(s - 1) {
                values[at] = w[s + 1];
            }
        }
        Self { stride: s, values }
    }

    /// Slopes by central differences.
    fn central_slope(&self, row: usize, u: usize) -> [f32; 2] {
        let at = (row + HALO) * self.stride + u + HALO;
        let w = &self.values;
        [0.5 * (w[at + 1] - w[at - 1]), 0.5 * (w[at + self.stride] - w[at - self.stride])]
    }
}

/// Least-squares slopes and mean of the inverse depth over the window around each pixel.
struct WindowFit {
    /// `Σ i ω`, `Σ j ω` and `Σ ω` over the window, row-major.
    sums: [Vec<f32>; 3],
}

impl WindowFit {
    const SIDE: usize = 2 * RADIUS + 1;
    /// `Σ i²` over the window.
    const SPREAD: f32 = (Self::SIDE * RADIUS * (RADIUS + 1) * Self::SIDE) as f32 / 3.0;

    fn new(smooth: &Padded, rows: usize) -> Self {
        let width = smooth.stride - 2 * HALO;
        let tap = |k: usize| k as f32 - RADIUS as f32;
        let mut along = [vec![0.0; width], vec![0.0; width]];
        let mut sums = [(); 3].map(|()| vec![0.0; width * rows]);
        for line in 0..rows + 2 * RADIUS {
            let source = &smooth.values[(line + HALO - RADIUS) * smooth.stride..][..smooth.stride];
            let [total, moment] = &mut along;
            total.fill(0.0);
            moment.fill(0.0);
            for k in 0..Self::SIDE {
                let shifted = &source[HALO - RADIUS + k..];
                for ((t, m), &w) in total.iter_mut().zip(moment.iter_mut()).zip(shifted) {
                    *t += w;
                    *m += tap(k) * w;
                }
            }
            for k in 0..Self::SIDE {
                let Some(row) = (line + k).checked_sub(2 * RADIUS).filter(|&row| row < rows) else { continue };
                // This line is the one `RADIUS - k` below the centre.
                let j = -tap(k);
                let [si, sj, s] = &mut sums;
                let out = row * width..(row + 1) * width;
                for ((((si, sj), s), &t), &m) in
                    si[out.clone()].iter_mut().zip(&mut sj[out.clone()]).zip(&mut s[out]).zip(&*total).zip(&*moment)
                {
                    *si += m;
                    *sj += j * t;
                    *s += t;
                }
            }
        }
        Self { sums }
    }

    /// `None` where the window has a gap or an edge, or is visibly not plane.
    fn slope(&self, at: usize, centre: f32, noise: &Noise) -> Option<[f32; 2]> {
        let [si, sj, s] = [0, 1, 2].map(|k: usize| self.sums[k][at]);
        let mean = s / (Self::SIDE * Self::SIDE) as f32;
        let plane = (mean - centre).abs() <= 3.0 * noise.sigma_inverse(centre);
        plane.then(|| [si / Self::SPREAD, sj / Self::SPREAD])
    }
}
