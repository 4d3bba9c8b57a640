//! The plane image: a depth image with a small plane fitted at every pixel.
//!
//! For a plane, inverse depth is a linear function of the pixel: `ω(u, v) = ω₀ + a (u - u₀) + b (v - v₀)`, whatever its
//! slope. So slopes come from linear filters, and a depth edge is where second differences of `ω` exceed the noise.

use nalgebra::Isometry3;

use crate::blocks::block_key::BlockKey;
use crate::blocks::voxel_block::{MAX_WEIGHT, ONE};
use crate::error::Error;
use crate::images::{DepthView, Intrinsics};
use crate::integration::block_selection::{select_around_rims, select_blocks};
use crate::integration::inverse_depth_noise::InverseDepthNoise;
use crate::integration::partial_window::{self, PartialWindow};
use crate::integration::plane::Plane;
use crate::integration::plane_tile::{TILE, Tile};
use crate::integration::plane_windows::{BEND_VARIANCE, BENDING, COUNT, ROUGHNESS, Row, SPREAD, Windows};
use crate::integration::rims::RimImage;
use crate::integration::voxel_lanes::mask;
use crate::parallel::in_chunks;
use crate::rounding::{ROUNDER, max, min};
use crate::settings::Settings;
use crate::widest::{self, Work};

/// Steeper views of a surface are left to other frames (ours: 84 degrees between ray and normal).
const LEAST_COSINE: f32 = 0.1;
/// A window whose rim is this many standard deviations off its middle is not plane (ours).
const MOST_BEND: f32 = 3.0;
/// Noise that is always granted, as a share of the model's: where the camera is better than the model, bends are found
/// by what it shows (ours).
const LEAST_NOISE: f32 = 0.1;
/// Pixels that are searched for edges at once.
const SCAN: usize = 8;

/// All pixels of a frame, with the blocks near them.
#[derive(Default)]
pub(crate) struct PlaneImage {
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// Row-major.
    pub(crate) planes: Vec<Plane>,
    /// Inverse depths of the pixels, 1/m; 0 where one is not fused.
    pub(crate) omegas: Vec<f32>,
    /// The fused depths in squares of [`TILE`] pixels, row-major.
    pub(crate) tiles: Vec<Tile>,
    /// The free space beside the rims of near surfaces.
    pub(crate) rims: RimImage,
    /// Pixels with a depth in the range.
    pub(crate) valid: usize,
    /// Those of them that are fused.
    pub(crate) fused: usize,
    /// Gaps between them that are filled and fused.
    pub(crate) filled: usize,
    /// The blocks that may hold a voxel within `μ` of a fused pixel, ascending.
    pub(crate) keys: Vec<BlockKey>,
}

/// Rows `first..` of the output, as many as the slices hold.
struct Band<'a> {
    first: usize,
    planes: &'a mut [Plane],
    omegas: &'a mut [f32],
    tiles: &'a mut [Tile],
}

impl PlaneImage {
    /// Reads a frame, keeping the buffers of the last one.
    pub(crate) fn read(
        &mut self,
        depth: &DepthView,
        world_from_camera: &Isometry3<f64>,
        settings: &Settings,
    ) -> Result<(), Error> {
        let (width, height) = (depth.width, depth.height);
        (self.width, self.height) = (width, height);
        self.planes.resize(width * height, Plane::NONE);
        self.omegas.resize(width * height, 0.0);
        self.tiles.resize(width.div_ceil(TILE) * height.div_ceil(TILE), Tile::EMPTY);
        // Whole tiles, so that each band can look for its own blocks.
        let lines = height.div_ceil(TILE).div_ceil(settings.threads);
        let pixels = lines * TILE * width;
        let pixels = self.planes.chunks_mut(pixels).zip(self.omegas.chunks_mut(pixels));
        let mut bands: Vec<Band> = pixels
            .zip(self.tiles.chunks_mut(lines * width.div_ceil(TILE)))
            .enumerate()
            .map(|(k, ((planes, omegas), tiles))| Band { first: k * lines * TILE, planes, omegas, tiles })
            .collect();
        let found = in_chunks(&mut bands, settings.threads, |bands| {
            let mut all = ([0; 3], Ok(Vec::new()), Vec::new());
            for band in bands {
                let (counts, edges) = widest::run(BandFilling { band, depth, settings });
                let keys = select_blocks(band.first, band.omegas, band.tiles, depth, world_from_camera, settings);
                all = ([0, 1, 2].map(|k| all.0[k] + counts[k]), keys, edges);
            }
            all
        });
        (self.valid, self.fused, self.filled) = (0, 0, 0);
        self.keys.clear();
        let mut all_edges = Vec::new();
        for ([valid, fused, filled], keys, edges) in found {
            self.valid += valid;
            self.fused += fused;
            self.filled += filled;
            self.keys.extend(keys?);
            all_edges.extend(edges);
        }
        self.find_rims(&all_edges, depth, world_from_camera, settings)?;
        self.keys.sort_unstable();
        self.keys.dedup();
        if self.fused == 0 { Err(Error::NoDepth { valid: self.valid }) } else { Ok(()) }
    }

    /// Finds the rims among the pixels beside edges, tells the tiles, and adds the blocks around them.
    fn find_rims(
        &mut self,
        edges: &[u32],
        depth: &DepthView,
        world_from_camera: &Isometry3<f64>,
        settings: &Settings,
    ) -> Result<(), Error> {
        self.rims.find(self.width, &self.omegas, edges, &depth.intrinsics, settings);
        let across = self.width.div_ceil(TILE);
        for &pixel in &self.rims.beside {
            let (z, v) = (self.rims.rims[pixel as usize].depth(), pixel / self.width as u32);
            let u = pixel - v * self.width as u32;
            let range = &mut self.tiles[v as usize / TILE * across + u as usize / TILE].rims;
            *range = [min(range[0], z), max(range[1], z)];
        }
        let sources = self.rims.sources.iter().map(|&pixel| {
            let pixel = pixel as usize;
            ([pixel % self.width, pixel / self.width], self.omegas[pixel])
        });
        self.keys.extend(select_around_rims(sources, depth, world_from_camera, settings)?);
        Ok(())
    }
}

/// A band that is to be filled.
struct BandFilling<'a, 'b> {
    band: &'a mut Band<'b>,
    depth: &'a DepthView<'a>,
    settings: &'a Settings,
}

impl Work for BandFilling<'_, '_> {
    type Output = ([usize; 3], Vec<u32>);

    #[inline(always)]
    fn run(self) -> Self::Output {
        self.band.fill(self.depth, self.settings)
    }
}

impl Band<'_> {
    /// Returns how many pixels of the band have a depth in the range, how many of them are fused, and how many gaps are filled.
    #[inline(always)]
    fn fill(&mut self, depth: &DepthView, settings: &Settings) -> ([usize; 3], Vec<u32>) {
        let width = depth.width;
        let noise = InverseDepthNoise::new(settings);
        let per_metre = (f64::from(ONE) / settings.truncation()) as f32;
        let mut windows = Windows::new(depth, settings, self.first);
        let mut columns = Columns::new(width);
        let partial = PartialWindow::new(&depth.intrinsics, noise);
        let mut all = [0; 3];
        let mut edges = Vec::new();
        for (row, (planes, omegas)) in self.planes.chunks_mut(width).zip(self.omegas.chunks_mut(width)).enumerate() {
            let lens = Lens::new(&depth.intrinsics, self.first + row, per_metre);
            let line = windows.row(row);
            read_row(&line, lens, noise, &mut columns, omegas);
            let start = ((self.first + row) * width) as u32;
            read_edges(&line, lens, noise, partial, &mut columns, omegas, |u| edges.push(start + u as u32));
            let counts = count(line.measured, omegas);
            columns.write(omegas, planes);
            all = [0, 1, 2].map(|k| all[k] + counts[k] as usize);
        }
        let lines = self.planes.chunks(TILE * width).zip(self.omegas.chunks(TILE * width));
        for (line, ((planes, omegas), tiles)) in lines.zip(self.tiles.chunks_mut(width.div_ceil(TILE))).enumerate() {
            for (k, tile) in tiles.iter_mut().enumerate() {
                *tile = Tile::of(width, [k * TILE, self.first + line * TILE], planes, omegas);
            }
        }
        (all, edges)
    }
}

/// A row of planes.
struct Columns {
    offset: Vec<f32>,
    slope: [Vec<f32>; 2],
    /// The pixels beside gaps and edges.
    edges: Vec<usize>,
}

impl Columns {
    fn new(width: usize) -> Self {
        let column = || vec![0.0; width];
        Self { offset: column(), slope: [column(), column()], edges: Vec::new() }
    }

    #[inline(always)]
    fn write(&self, omegas: &[f32], planes: &mut [Plane]) {
        let slopes = self.slope[0].iter().zip(&self.slope[1]);
        for (((plane, &offset), &omega), (&u, &v)) in planes.iter_mut().zip(&self.offset).zip(omegas).zip(slopes) {
            *plane = Plane { offset, scaled_omega: offset * omega, scaled_slope: [u, v] };
        }
    }
}

/// Fits the planes of a row. Structures of arrays, because the
/// arithmetic then runs in vector registers.
#[inline(always)]
fn read_row(row: &Row, lens: Lens, noise: InverseDepthNoise, out: &mut Columns, omegas: &mut [f32]) {
    // Slices of known length spare the loop its bounds checks.
    let width = omegas.len();
    let offsets = &mut out.offset[..width];
    let [slopes_u, slopes_v] = &mut out.slope;
    let (slopes_u, slopes_v) = (&mut slopes_u[..width], &mut slopes_v[..width]);
    let [above, here, below] = row.around;
    let (above, here, below) = (&above[..width + 2], &here[..width + 2], &below[..width + 2]);
    let (smooth, total, bend) = (&row.smooth[..width], &row.total[..width], &row.bend[..width]);
    let (along, down, rough) = (&row.slope[0][..width], &row.slope[1][..width], &row.roughness[..width]);
    let most_bend = (MOST_BEND * BENDING) * (MOST_BEND * BENDING) * BEND_VARIANCE;
    for u in 0..width {
        let own = here[u + 1];
        let sigma = noise.sigma_inverse(own);
        // A NaN fails.
        let shown = rough[u] * (1.0 / ROUGHNESS) + LEAST_NOISE * LEAST_NOISE * sigma * sigma;
        let granted = if shown < sigma * sigma { shown } else { sigma * sigma };
        let is_plane = u32::from(bend[u] * bend[u] <= most_bend * granted).wrapping_neg();
        let wide = [total[u] * (1.0 / COUNT), along[u] * (1.0 / SPREAD), down[u] * (1.0 / SPREAD)];
        let narrow = [smooth[u], 0.5 * (here[u + 2] - here[u]), 0.5 * (below[u + 1] - above[u + 1])];
        let omega = choose(is_plane, wide[0], narrow[0]);
        let slope_u = choose(is_plane, wide[1], narrow[1]);
        let slope_v = choose(is_plane, wide[2], narrow[2]);
        let seen = observe(lens, noise, u, omega, [slope_u, slope_v]);
        offsets[u] = seen.offset;
        omegas[u] = seen.omega;
        slopes_u[u] = seen.slope_u;
        slopes_v[u] = seen.slope_v;
    }
}

/// The pixels beside gaps and edges that [`read_row`] has left out.
#[inline(always)]
fn read_edges(
    row: &Row,
    lens: Lens,
    noise: InverseDepthNoise,
    partial: PartialWindow,
    out: &mut Columns,
    omegas: &mut [f32],
    mut found: impl FnMut(usize),
) {
    let is_edge = |measured: f32, smooth: f32| (measured > 0.0) & smooth.is_nan();
    out.edges.clear();
    for (first, (measured, smooth)) in (0..).step_by(SCAN).zip(row.measured.chunks(SCAN).zip(row.smooth.chunks(SCAN))) {
        if let (Some(measured), Some(smooth)) = (measured.first_chunk::<SCAN>(), smooth.first_chunk::<SCAN>()) {
            let mut any = 0;
            for k in 0..SCAN {
                any |= mask(is_edge(measured[k], smooth[k]));
            }
            if any == 0 {
                continue;
            }
        }
        let pixels = (first..).zip(measured.iter().zip(smooth));
        out.edges.extend(pixels.filter(|&(_, (&measured, &smooth))| is_edge(measured, smooth)).map(|(u, _)| u));
    }
    for group in out.edges.chunks(partial_window::LANES) {
        let [along, down] = partial.slopes(row.wide, std::array::from_fn(|k| *group.get(k).unwrap_or(&group[0])));
        for (k, &u) in group.iter().enumerate().filter(|&(k, _)| !along[k].is_nan()) {
            let seen = observe(lens, noise, u, row.measured[u], [along[k], down[k]]);
            // Rounded as the plane keeps it.
            (out.offset[u], omegas[u]) = (seen.offset, seen.offset * seen.omega / seen.offset);
            (out.slope[0][u], out.slope[1][u]) = (seen.slope_u, seen.slope_v);
            found(u);
        }
    }
}

/// Pixels that were measured, those of them that are fused, and gaps that are filled.
#[inline(always)]
fn count(measured: &[f32], omega: &[f32]) -> [u32; 3] {
    let (mut valid, mut fused, mut both) = (0, 0, 0);
    for (&measured, &omega) in measured.iter().zip(omega) {
        let (is_valid, is_fused) = (u32::from(measured > 0.0), u32::from(omega > 0.0));
        valid += is_valid;
        fused += is_fused;
        both += is_valid & is_fused;
    }
    [valid, both, fused - both]
}

/// A plane at a pixel, as [`Plane`] keeps it; with an inverse depth of 0 if it is seen too steeply, or is none.
struct Observation {
    offset: f32,
    omega: f32,
    slope_u: f32,
    slope_v: f32,
}

#[inline(always)]
fn observe(lens: Lens, noise: InverseDepthNoise, u: usize, omega: f32, [slope_u, slope_v]: [f32; 2]) -> Observation {
    let (offset, cosine) = lens.plane(u as i32 as f32, omega, slope_u, slope_v);
    let ratio = noise.base * omega * omega / noise.sigma_inverse(omega);
    let weight = MAX_WEIGHT * ratio * ratio * cosine;
    let weight = if weight > 1.0 { weight } else { 1.0 };
    let weight = if weight < MAX_WEIGHT { weight } else { MAX_WEIGHT };
    // A NaN fails both comparisons.
    let omega = if cosine >= LEAST_COSINE { omega } else { 0.0 };
    let omega = if omega > 0.0 { omega } else { 0.0 };
    let last = (offset * slope_v).to_bits() & !15 | (weight + ROUNDER).to_bits() & 15;
    Observation { offset, omega, slope_u: offset * slope_u, slope_v: f32::from_bits(last) }
}

/// One of two values, by a mask of all ones or zero: an `if` would become a branch, and the loop scalar.
#[inline(always)]
fn choose(mask: u32, one: f32, other: f32) -> f32 {
    f32::from_bits(one.to_bits() & mask | other.to_bits() & !mask)
}

/// The camera, seen from one row of its image.
#[derive(Clone, Copy)]
struct Lens {
    focal: [f32; 2],
    inverse_focal: f32,
    /// Steps of the stored distance per metre.
    per_metre: f32,
    cx: f32,
    /// Row of the pixel from the principal point, in pixels, and squared in focal lengths.
    dv: f32,
    ray: f32,
}

impl Lens {
    fn new(k: &Intrinsics, v: usize, per_metre: f32) -> Self {
        let dv = v as f64 - k.cy;
        Self {
            focal: [k.fx as f32, k.fy as f32],
            inverse_focal: (1.0 / k.fx) as f32,
            per_metre,
            cx: k.cx as f32,
            dv: dv as f32,
            ray: ((dv / k.fy) * (dv / k.fy) + 1.0) as f32,
        }
    }

    /// The plane with this inverse depth and these slopes at a pixel: its distance from the camera in steps of the
    /// stored distance, and the cosine between its normal and the ray.
    #[inline(always)]
    fn plane(&self, u: f32, omega: f32, slope_u: f32, slope_v: f32) -> (f32, f32) {
        let du = u - self.cx;
        // With x = z (du / fx, dv / fy, 1), the plane is n · x = 1.
        let n = [self.focal[0] * slope_u, self.focal[1] * slope_v, omega - slope_u * du - slope_v * self.dv];
        let squared = n[0] * n[0] + n[1] * n[1] + n[2] * n[2];
        let ray = du * self.inverse_focal;
        (self.per_metre / squared.sqrt(), omega / (squared * (ray * ray + self.ray)).sqrt())
    }
}
