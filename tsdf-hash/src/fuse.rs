//! The update of one block by one frame.

use nalgebra::{Isometry3, Matrix3, Vector3};

use crate::Settings;
use crate::block::{Block, MAX_COLOURS, ONE, SIDE};
use crate::key::Key;
use crate::surface::{Surface, TILE, Tile};
use crate::view::{ColourData, ColourView, Intrinsics};

/// Colours are taken this close to the surface, in voxels (ours).
const COLOUR_REACH: f64 = 1.5;
/// `1.5 2^23`: adding it rounds a float to an integer, to even at a tie, and leaves the integer in the low bits.
pub(crate) const ROUNDER: f32 = 12_582_912.0;

/// Whether a frame is put in or taken out.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Sign {
    Plus,
    Minus,
}

impl Sign {
    pub(crate) fn opposite(self) -> Self {
        if self == Self::Plus { Self::Minus } else { Self::Plus }
    }
}

/// What an update did.
#[derive(Clone, Copy, Default)]
pub(crate) struct Tally {
    /// Voxels touched.
    pub(crate) voxels: usize,
    /// A counter ran over (plus) or under (minus). The sums wrap, so the opposite update restores the block exactly.
    pub(crate) fault: bool,
}

/// A frame, ready to be applied to any block.
pub(crate) struct Frame<'a> {
    pub(crate) surface: &'a Surface,
    pub(crate) colour: Option<ColourSource<'a>>,
    /// `(u z, v z, z)` from a point in the world.
    projection: Matrix3<f64>,
    offset: Vector3<f64>,
    voxel_size: f64,
    pub(crate) truncation: f32,
    /// In steps of the stored distance.
    pub(crate) colour_reach: f32,
    width: i32,
    /// The last column and the last row.
    last: [f32; 2],
}

impl<'a> Frame<'a> {
    pub(crate) fn new(
        surface: &'a Surface,
        intrinsics: &Intrinsics,
        colour: Option<&'a ColourView<'a>>,
        world_from_camera: &Isometry3<f64>,
        settings: &Settings,
    ) -> Self {
        let k = intrinsics;
        let pixels_from_camera = Matrix3::new(k.fx, 0.0, k.cx, 0.0, k.fy, k.cy, 0.0, 0.0, 1.0);
        let camera_from_world = world_from_camera.inverse();
        Self {
            surface,
            colour: colour.map(|view| ColourSource::new(view, k, surface)),
            projection: pixels_from_camera * camera_from_world.rotation.to_rotation_matrix().into_inner(),
            offset: pixels_from_camera * camera_from_world.translation.vector,
            voxel_size: settings.voxel_size,
            truncation: settings.truncation() as f32,
            width: surface.width as i32,
            last: [surface.width, surface.height].map(|side| (side - 1) as f32),
            colour_reach: (f64::from(ONE) * COLOUR_REACH / settings.truncation_voxels) as f32,
        }
    }

    /// Adds the frame to a block, or takes it out. What is touched, and by how much, depends on the frame only.
    pub(crate) fn apply(&self, sign: Sign, key: Key, block: &mut Block) -> Tally {
        match sign {
            Sign::Plus => self.update::<true>(key, block),
            Sign::Minus => self.update::<false>(key, block),
        }
    }

    /// `(u z, v z, z)` of the first voxel of a block.
    pub(crate) fn start(&self, key: Key) -> Vector3<f32> {
        let centre = |c: i32| (f64::from(c) * SIDE as f64 + 0.5) * self.voxel_size;
        let [x, y, z] = key.block().map(centre);
        (self.projection * Vector3::new(x, y, z) + self.offset).cast()
    }

    /// Its change from a voxel to the next, a column for each axis.
    pub(crate) fn step(&self) -> Matrix3<f32> {
        (self.projection * self.voxel_size).cast()
    }

    /// In single precision, every operation rounded once to the nearest, none fused or reordered:
    ///
    /// ```text
    /// per frame      step_x, step_y, step_z                          the change of (u z, v z, z) from voxel to voxel
    /// per block      start                                           (u z, v z, z) of voxel (0, 0, 0)
    /// per voxel      p = ((start + step_y y) + step_z z) + step_x x
    ///                r = 1 / p.z;  u = p.x r;  v = p.y r             correctly rounded division
    ///                i = round(u);  j = round(v)                     to even at a tie
    ///                p.z > 0, 0 <= i <= width - 1, 0 <= j <= height - 1, or the voxel is not touched
    ///                plane = planes[i + width j]
    ///                own = p.z scaled_omega
    ///                |offset - own| <= μ scaled_omega, or the voxel is not touched
    ///                du = u - i;  dv = v - j
    ///                q = offset - p.z (scaled_omega + (slope_u du + slope_v dv))
    ///                coloured = |q| < reach
    ///                q = round(min(max(q, -32767), 32767))
    ///                w = the last four bits of slope_v
    ///                S += w q;  W += w                               in integers
    /// ```
    ///
    /// `start` and the steps are computed in double precision and rounded once.
    fn update<const PLUS: bool>(&self, key: Key, block: &mut Block) -> Tally {
        let (start, step) = (self.start(key), self.step());
        let [sx, sy, sz] = [0, 1, 2].map(|axis| step.column(axis).into_owned());
        let steps = [sx, sy, sz];
        let Some(slab) = self.slab(&start, &steps) else { return Tally::default() };
        let offsets = [0, LANES].map(|first| Offsets::new(&sx, first));
        let mut work = Work::default();
        for z in 0..SIDE {
            for y in 0..SIDE {
                let along = slab.start + slab.step[1] * y as f32 + slab.step[2] * z as f32;
                let row = (start + sy * y as f32) + sz * z as f32;
                for (half, (offsets, [least, most])) in offsets.iter().zip(slab.bounds).enumerate() {
                    if along >= least && along <= most {
                        let lanes = self.project(&row, offsets);
                        self.observe::<PLUS>(block, half + HALVES * (y + SIDE * z), &lanes, &mut work);
                    }
                }
            }
        }
        work.tally()
    }

    /// Where in a block voxels can be touched, from the squares of pixels that it projects to; `None` if nowhere.
    ///
    /// If the inverse depth under the block is a linear function of the pixel, `1 - z ω` is one of the voxel. A voxel is
    /// touched if it is at most `μ ω`; an inverse depth that is `e` off the function adds `z e`.
    fn slab(&self, start: &Vector3<f32>, steps: &[Vector3<f32>; 3]) -> Option<Slab> {
        let (mut low, mut high) = ([f32::INFINITY; 2], [f32::NEG_INFINITY; 2]);
        let mut far = 0.0_f32;
        for corner in 0..8 {
            let at = |axis: usize| steps[axis] * if corner >> axis & 1 == 1 { (SIDE - 1) as f32 } else { 0.0 };
            let p = start + at(0) + at(1) + at(2);
            if p.z < NEAREST {
                return Some(Slab::ALL);
            }
            far = far.max(p.z);
            for k in 0..2 {
                let pixel = p[k] / p.z;
                low[k] = low[k].min(pixel);
                high[k] = high[k].max(pixel);
            }
        }
        let sides = [self.surface.width, self.surface.height];
        let mut ranges = [(0, 0); 2];
        for k in 0..2 {
            // A pixel more on each side, for the rounding.
            let last = (sides[k] - 1) as f32;
            if low[k] > last + 1.0 || high[k] < -1.0 {
                return None;
            }
            ranges[k] = ((low[k] - 1.0).max(0.0) as usize / TILE, (high[k] + 1.0).min(last) as usize / TILE);
        }
        let across = sides[0].div_ceil(TILE);
        let [columns, lines] = ranges;
        let line = |line: usize| &self.surface.tiles[line * across + columns.0..=line * across + columns.1];
        // The flattest square speaks for all.
        let mut flattest = &Tile::EMPTY;
        for tile in (lines.0..=lines.1).flat_map(line) {
            if !tile.is_empty() && (flattest.is_empty() || tile.error < flattest.error) {
                flattest = tile;
            }
        }
        if flattest.is_empty() {
            return None;
        }
        let omega = flattest.omega;
        let (mut error, mut near) = (0.0_f32, f32::INFINITY);
        for k in lines.0..=lines.1 {
            for (column, tile) in (columns.0..).zip(line(k)) {
                // Two linear functions differ most at a corner; half a square more than there is, at the image's rim.
                let half = 0.5 * TILE as f32;
                let [u, v] = [column, k].map(|k| (k * TILE) as f32 + half);
                let off = (tile.omega.at(u, v) - omega.at(u, v)).abs();
                let turn = (tile.omega.slope[0] - omega.slope[0]).abs() + (tile.omega.slope[1] - omega.slope[1]).abs();
                let bound = tile.error + off + half * turn;
                if !tile.is_empty() {
                    error = error.max(bound);
                    near = near.min(tile.near);
                }
            }
        }
        let along = |p: &Vector3<f32>| omega.base * p.z + omega.slope[0] * p.x + omega.slope[1] * p.y;
        // Half a pixel between a voxel's projection and its pixel; and a little for the rounding.
        let error = error + 0.5 * (omega.slope[0].abs() + omega.slope[1].abs());
        let reach = 1.001 * (self.truncation / near + far * error) + 1e-4;
        Some(Slab::new(1.0 - along(start), [0, 1, 2].map(|k| -along(&steps[k])), reach))
    }

    #[inline(always)]
    fn project(&self, row: &Vector3<f32>, offsets: &Offsets) -> Lanes {
        let zero = [0.0; LANES];
        let mut out =
            Lanes { inside: [0; LANES], index: [0; LANES], depth: zero, u: zero, v: zero, du: zero, dv: zero };
        for x in 0..LANES {
            let z = row.z + offsets.depth[x];
            let inverse = 1.0 / z;
            let u = (row.x + offsets.u[x]) * inverse;
            let v = (row.y + offsets.v[x]) * inverse;
            let (i, j) = ((u + ROUNDER) - ROUNDER, (v + ROUNDER) - ROUNDER);
            (out.depth[x], out.u[x], out.v[x], out.du[x], out.dv[x]) = (z, u, v, u - i, v - j);
            let inside =
                mask(z > 0.0) & mask(i >= 0.0) & mask(i <= self.last[0]) & mask(j >= 0.0) & mask(j <= self.last[1]);
            // Sides are at most 16384: fifteen bits hold what is inside, and SSE2 multiplies no wider integers at once.
            let index = (rounded(v) & 0x7fff) * (self.width & 0x7fff) + (rounded(u) & 0x7fff);
            out.inside[x] = inside;
            out.index[x] = index & inside;
        }
        out
    }

    /// Updates the voxels `LANES unit..`.
    #[inline(always)]
    fn observe<const PLUS: bool>(&self, block: &mut Block, unit: usize, lanes: &Lanes, work: &mut Work) {
        let planes = lanes.index.map(|index| self.surface.planes[index as usize]);
        let offset = planes.map(|plane| plane.offset);
        let omega = planes.map(|plane| plane.scaled_omega);
        let slope_u = planes.map(|plane| plane.scaled_slope[0]);
        let slope_v = planes.map(|plane| plane.scaled_slope[1]);
        let mut touched = [0; LANES];
        for x in 0..LANES {
            // A NaN fails, and so does an omega of 0.
            let within = (offset[x] - lanes.depth[x] * omega[x]).abs() <= self.truncation * omega[x];
            touched[x] = mask(within) & lanes.inside[x];
        }
        if touched == [0; LANES] {
            return;
        }
        let sums = &mut block.distance.as_chunks_mut::<LANES>().0[unit];
        let totals = &mut block.weight.as_chunks_mut::<LANES>().0[unit];
        let mut coloured = [0; LANES];
        for x in 0..LANES {
            let at_voxel = omega[x] + (slope_u[x] * lanes.du[x] + slope_v[x] * lanes.dv[x]);
            let q = offset[x] - lanes.depth[x] * at_voxel;
            coloured[x] = mask(q.abs() < self.colour_reach) & touched[x];
            let q = if q > -LIMIT { q } else { -LIMIT };
            let q = if q < LIMIT { q } else { LIMIT };
            let weight = slope_v[x].to_bits().cast_signed() & 15 & touched[x];
            // An integer below 2^19, so the product is exact.
            let product = rounded(((q + ROUNDER) - ROUNDER) * weight as f32) & touched[x];
            let (sum, total) = if PLUS {
                (sums[x].wrapping_add(product), i32::from(totals[x]) + weight)
            } else {
                (sums[x].wrapping_sub(product), i32::from(totals[x]) - weight)
            };
            sums[x] = sum;
            totals[x] = total as u16;
            work.faults[x] |= total;
            if !PLUS {
                // No sum of observations can leave `-32767 W..=32767 W`: what was taken out was not in.
                let most = (total << 15).wrapping_sub(total);
                work.faults[x] |= most.wrapping_sub(sum.wrapping_abs()) & i32::MIN & touched[x];
            }
            work.touched[x] -= touched[x];
        }
        if let Some(colour) = self.colour.as_ref().filter(|_| coloured != [0; LANES]) {
            for x in 0..LANES {
                if coloured[x] != 0
                    && let Some(rgb) = colour.at(lanes, x)
                {
                    work.colour_fault |= observe_colour::<PLUS>(&mut block.colour[LANES * unit + x], rgb);
                }
            }
        }
    }
}

/// Blocks closer to the camera's plane are searched voxel by voxel, metres.
const NEAREST: f32 = 1e-2;

/// The voxels where a linear function of their indices is between `-reach` and `reach`.
struct Slab {
    start: f32,
    step: [f32; 3],
    /// Of a row, from the function at its first voxel: where the lanes of each half can be in the slab.
    bounds: [[f32; 2]; HALVES],
}

impl Slab {
    const ALL: Self = Self { start: 0.0, step: [0.0; 3], bounds: [[-1.0, 1.0]; HALVES] };

    fn new(start: f32, step: [f32; 3], reach: f32) -> Self {
        let bounds = [0, LANES].map(|x| {
            let ends = [x, x + LANES - 1].map(|x| step[0] * x as f32);
            [-reach - ends[0].max(ends[1]), reach - ends[0].min(ends[1])]
        });
        Self { start, step, bounds }
    }
}

/// Of a row of voxels.
const HALVES: usize = SIDE / LANES;
/// Neighbours along x that are updated together: a vector register.
const LANES: usize = 4;
const LIMIT: f32 = ONE as f32;

/// All ones, or zero.
#[inline(always)]
fn mask(condition: bool) -> i32 {
    -i32::from(condition)
}

/// The nearest integer, to even at a tie, of a float below `2^22` in magnitude.
#[inline(always)]
fn rounded(x: f32) -> i32 {
    (x + ROUNDER).to_bits().wrapping_sub(ROUNDER.to_bits()).cast_signed()
}

/// Adds a colour to sums or takes it out; returns whether a counter ran over or under.
#[inline(always)]
fn observe_colour<const PLUS: bool>(sums: &mut [u16; 4], rgb: [u16; 3]) -> bool {
    for (sum, c) in sums.iter_mut().zip([rgb[0], rgb[1], rgb[2], 1]) {
        *sum = if PLUS { sum.wrapping_add(c) } else { sum.wrapping_sub(c) };
    }
    let [r, g, b, n] = *sums;
    // A sum that ran under is at least 65536 - 63, more than 63 n for any other n than the one just refused.
    let most = n.wrapping_mul(63);
    n > MAX_COLOURS || (!PLUS && (r > most || g > most || b > most))
}

/// `round(63 c / 255)`.
#[inline(always)]
fn six_bits(c: u8) -> u16 {
    ((u32::from(c) * 253 + 505) >> 10) as u16
}

/// What the update of a block counts, per lane.
#[derive(Default)]
struct Work {
    touched: [i32; LANES],
    /// All counters: they ran over or under if there is a bit beyond the sixteenth.
    faults: [i32; LANES],
    colour_fault: bool,
}

impl Work {
    fn tally(&self) -> Tally {
        let voxels = self.touched.iter().sum::<i32>().unsigned_abs() as usize;
        Tally { voxels, fault: self.colour_fault || self.faults.iter().any(|bits| bits >> 16 != 0) }
    }
}

/// Projected voxels.
struct Lanes {
    /// All ones in the image, zero outside.
    inside: [i32; LANES],
    /// Of the pixel; 0 outside the image.
    index: [i32; LANES],
    depth: [f32; LANES],
    /// The projection, pixels.
    u: [f32; LANES],
    v: [f32; LANES],
    /// From the pixel's centre to the projection.
    du: [f32; LANES],
    dv: [f32; LANES],
}

/// From the first voxel of a row to some neighbours: the change of `(u z, v z, z)`.
struct Offsets {
    u: [f32; LANES],
    v: [f32; LANES],
    depth: [f32; LANES],
}

impl Offsets {
    fn new(step: &Vector3<f32>, first: usize) -> Self {
        let along: [f32; LANES] = std::array::from_fn(|x| (first + x) as f32);
        Self { u: along.map(|x| step.x * x), v: along.map(|x| step.y * x), depth: along.map(|x| step.z * x) }
    }
}

/// The colour image, seen from the depth image.
pub(crate) struct ColourSource<'a> {
    pub(crate) data: ColourData<'a>,
    pub(crate) width: usize,
    /// Whether its pixels are those of the depth image.
    pub(crate) is_aligned: bool,
    /// Colour column = `scale u + shift`, likewise the row.
    pub(crate) scale: [f32; 2],
    pub(crate) shift: [f32; 2],
    /// The last column and the last row.
    pub(crate) last: [f32; 2],
}

impl<'a> ColourSource<'a> {
    fn new(view: &'a ColourView<'a>, depth: &Intrinsics, surface: &Surface) -> Self {
        let c = &view.intrinsics;
        let scale = [c.fx / depth.fx, c.fy / depth.fy];
        let shift = [c.cx - scale[0] * depth.cx, c.cy - scale[1] * depth.cy];
        let last = [view.width, view.height].map(|side| (side - 1) as f32);
        let is_aligned = (view.width, view.height) == (surface.width, surface.height) && c == depth;
        Self {
            data: view.data,
            width: view.width,
            is_aligned,
            scale: scale.map(|s| s as f32),
            shift: shift.map(|s| s as f32),
            last,
        }
    }

    /// Six-bit colour of the pixel nearest to the projection; `None` outside the colour image.
    #[inline(always)]
    fn at(&self, lanes: &Lanes, x: usize) -> Option<[u16; 3]> {
        let pixel = if self.is_aligned {
            lanes.index[x] as usize
        } else {
            let i = (lanes.u[x] * self.scale[0] + self.shift[0] + ROUNDER) - ROUNDER;
            let j = (lanes.v[x] * self.scale[1] + self.shift[1] + ROUNDER) - ROUNDER;
            if !(i >= 0.0 && i <= self.last[0] && j >= 0.0 && j <= self.last[1]) {
                return None;
            }
            rounded(j) as usize * self.width + rounded(i) as usize
        };
        let start = 3 * pixel;
        match self.data {
            ColourData::Rgb8(data) => {
                let rgb = data.get(start..start + 3)?;
                Some([six_bits(rgb[0]), six_bits(rgb[1]), six_bits(rgb[2])])
            }
            ColourData::Rgb16(data) => {
                let rgb = data.get(start..start + 3)?;
                Some([rgb[0], rgb[1], rgb[2]].map(|c| ((u32::from(c) * 63 + 32767) / 65535) as u16))
            }
        }
    }
}
