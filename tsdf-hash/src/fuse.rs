//! The update of one block by one frame.

mod colour;
mod slab;
#[cfg(test)]
mod tests;

use colour::{ColourSource, observe_colour};
use nalgebra::{Isometry3, Matrix3, Vector3};
use slab::Slab;

use crate::Settings;
use crate::block::{Block, ONE, SIDE};
use crate::key::Key;
use crate::surface::Surface;
use crate::view::{ColourView, Intrinsics};

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
    /// Voxels are touched this far in front of a surface, from the one (behind it: `-μ`) to the other, metres.
    pub(crate) reach: [f32; 2],
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
            reach: [-settings.truncation(), settings.front()].map(|reach| reach as f32),
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
    ///                -μ scaled_omega <= offset - own <= front scaled_omega, or the voxel is not touched
    ///                du = u - i;  dv = v - j
    ///                q = offset - p.z (scaled_omega + (slope_u du + slope_v dv))
    ///                coloured = |q| < reach
    ///                q = round(min(max(q, -32767), 32767))
    ///                w = the last four bits of slope_v
    ///                S += w q;  W += w                               in integers
    /// ```
    ///
    /// `front` is `μ`, or the distance that is carved if that is larger. `start` and the steps are computed in double precision and rounded once.
    fn update<const PLUS: bool>(&self, key: Key, block: &mut Block) -> Tally {
        let (start, step) = (self.start(key), self.step());
        let [sx, sy, sz] = [0, 1, 2].map(|axis| step.column(axis).into_owned());
        let steps = [sx, sy, sz];
        let Some(slab) = Slab::under(self.surface, self.reach, &start, &steps) else { return Tally::default() };
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
            let ahead = offset[x] - lanes.depth[x] * omega[x];
            let within = mask(ahead >= self.reach[0] * omega[x]) & mask(ahead <= self.reach[1] * omega[x]);
            touched[x] = within & lanes.inside[x];
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
            for (x, &near) in coloured.iter().enumerate() {
                if near != 0
                    && let Some(rgb) = colour.at(lanes, x)
                {
                    work.colour_fault |= observe_colour::<PLUS>(&mut block.colour[LANES * unit + x], rgb);
                }
            }
        }
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
