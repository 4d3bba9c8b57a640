//! From a depth image to one small plane per pixel.
//!
//! For a plane, inverse depth is a linear function of the pixel: `ω(u, v) = ω₀ + a (u - u₀) + b (v - v₀)`, whatever its
//! slope. So slopes come from linear filters, and a depth edge is where second differences of `ω` exceed the noise.

mod window;

use nalgebra::Isometry3;
use window::{HALO, Padded, WindowFit};

use crate::block::MAX_WEIGHT;
use crate::fuse::ROUNDER;
use crate::key::Key;
use crate::parallel::in_chunks;
use crate::view::{DepthView, Intrinsics};
use crate::{Error, Settings, candidates};

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
    /// The blocks that may hold a voxel within `μ` of a fused pixel, ascending.
    pub(crate) keys: Vec<Key>,
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
        for (row, (inverse_depth, planes)) in
            self.inverse_depth.chunks_exact_mut(width).zip(self.planes.chunks_exact_mut(width)).enumerate()
        {
            let lines = Lines {
                around: [0, 1, 2].map(|k| raw.line(row + HALO - 1 + k, HALO - 1, width + 2)),
                smooth: smooth.line(row + HALO, HALO, width),
                fit: [0, 1, 2].map(|k| &fit.sums[k][row * width..(row + 1) * width]),
            };
            let lens = Lens::new(&depth.intrinsics, self.first + row);
            let counts = lines.planes(&lens, &noise, inverse_depth, planes);
            valid += counts[0] as usize;
            fused += counts[1] as usize;
        }
        (valid, fused)
    }
}

/// What one row of planes is made from.
struct Lines<'a> {
    /// The row above, the row itself and the row below, with one pixel more on each side.
    around: [&'a [f32]; 3],
    /// The row with NaN at edges.
    smooth: &'a [f32],
    fit: [&'a [f32]; 3],
}

impl Lines<'_> {
    /// Returns the numbers of valid and of fused pixels.
    fn planes(&self, lens: &Lens, noise: &Noise, inverse_depth: &mut [f32], planes: &mut [Plane]) -> [u32; 2] {
        // Slices of known length spare the loop its bounds checks.
        let width = inverse_depth.len();
        let [above, here, below] = self.around.map(|line| &line[..width + 2]);
        let (smooth, planes) = (&self.smooth[..width], &mut planes[..width]);
        let [fit_u, fit_v, fit_mean] = self.fit.map(|line| &line[..width]);
        let (lens, noise) = (*lens, *noise);
        let mut counts = [0, 0];
        for u in 0..width {
            let omega = here[u + 1];
            let sigma = noise.sigma_inverse(omega);
            // A gap or an edge in the window makes the mean NaN; far from the pixel's value, the window is not plane.
            let plane = (fit_mean[u] * WindowFit::PER_PIXEL - omega).abs() <= 3.0 * sigma;
            let wide = [fit_u[u] * WindowFit::PER_SPREAD, fit_v[u] * WindowFit::PER_SPREAD];
            let narrow = [0.5 * (here[u + 2] - here[u]), 0.5 * (below[u + 1] - above[u + 1])];
            let slope = [if plane { wide[0] } else { narrow[0] }, if plane { wide[1] } else { narrow[1] }];
            let (offset, cosine) = lens.plane(u as i32 as f32, omega, slope);
            let ratio = noise.base * omega * omega / sigma;
            let weight = (MAX_WEIGHT * ratio * ratio * cosine).clamp(1.0, MAX_WEIGHT);
            // A NaN fails both comparisons.
            let facing = if cosine >= LEAST_COSINE { smooth[u] } else { 0.0 };
            let fused = if facing > 0.0 { facing } else { 0.0 };
            inverse_depth[u] = fused;
            planes[u] = Plane { slope, offset, weight: (weight + ROUNDER) - ROUNDER };
            counts[0] += u32::from(omega > 0.0);
            counts[1] += u32::from(fused > 0.0);
        }
        counts
    }
}

/// The camera, seen from one row of its image.
#[derive(Clone, Copy)]
struct Lens {
    focal: [f32; 2],
    inverse_focal: f32,
    cx: f32,
    /// Row of the pixel from the principal point, in pixels, and squared in focal lengths.
    dv: f32,
    ray: f32,
}

impl Lens {
    fn new(k: &Intrinsics, v: usize) -> Self {
        let dv = v as f64 - k.cy;
        Self {
            focal: [k.fx as f32, k.fy as f32],
            inverse_focal: (1.0 / k.fx) as f32,
            cx: k.cx as f32,
            dv: dv as f32,
            ray: ((dv / k.fy) * (dv / k.fy) + 1.0) as f32,
        }
    }

    /// The plane through the pixel's own depth with the slopes of its neighbourhood: its distance from the camera and
    /// the cosine between its normal and the ray.
    #[inline(always)]
    fn plane(&self, u: f32, omega: f32, slope: [f32; 2]) -> (f32, f32) {
        let du = u - self.cx;
        // With x = z (du / fx, dv / fy, 1), the plane is n · x = 1.
        let n = [self.focal[0] * slope[0], self.focal[1] * slope[1], omega - slope[0] * du - slope[1] * self.dv];
        let squared = n[0] * n[0] + n[1] * n[1] + n[2] * n[2];
        let ray = du * self.inverse_focal;
        (1.0 / squared.sqrt(), omega / (squared * (ray * ray + self.ray)).sqrt())
    }
}

/// The noise model in the working precision.
#[derive(Clone, Copy)]
struct Noise {
    base: f32,
    quadratic: f32,
    nearest: f32,
}

impl Noise {
    fn new(settings: &Settings) -> Self {
        let n = &settings.noise;
        Self { base: n.base as f32, quadratic: n.quadratic as f32, nearest: n.nearest as f32 }
    }

    /// Standard deviation of the inverse depth, `σ(1/ω) ω²`, 1/m.
    #[inline(always)]
    fn sigma_inverse(&self, omega: f32) -> f32 {
        let beyond = 1.0 - self.nearest * omega;
        self.base * omega * omega + self.quadratic * beyond * beyond
    }
}
