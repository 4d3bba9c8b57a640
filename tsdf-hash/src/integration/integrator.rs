//! The update of one block by one frame.

use nalgebra::{Isometry3, Matrix3, Vector3};

use crate::blocks::block_key::BlockKey;
use crate::blocks::voxel_block::{ONE, SIDE, VoxelBlock};
use crate::error::Error;
use crate::images::{ColourView, DepthView, Intrinsics, check_pose};
use crate::integration::block_bounds::BlockBounds;
use crate::integration::colour::{ColourSource, accumulate_colour};
use crate::integration::plane_image::PlaneImage;
use crate::integration::rims::{self, Rim};
use crate::integration::voxel_lanes::{LANES, ProjectedVoxels, RowOffsets, mask};
use crate::rounding::{ROUNDER, max, min, rounded};
use crate::settings::Settings;
use crate::widest::{self, Work};

/// Colours are taken this close to the surface, in voxels (ours).
const COLOUR_REACH: f64 = 1.5;

/// Whether a frame is put in or taken out.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Operation {
    Integrate,
    Deintegrate,
}

impl Operation {
    pub(crate) fn opposite(self) -> Self {
        if self == Self::Integrate { Self::Deintegrate } else { Self::Integrate }
    }
}

/// What an update did.
#[derive(Clone, Copy, Default)]
pub(crate) struct UpdateCount {
    /// Voxels touched.
    pub(crate) voxels: usize,
    /// A counter ran over (plus) or under (minus). The sums wrap, so the opposite update restores the block exactly.
    pub(crate) overflow: bool,
}

/// A frame, ready to be applied to any block.
pub(crate) struct Frame<'a> {
    pub(crate) plane_image: &'a PlaneImage,
    pub(crate) colour: Option<ColourSource<'a>>,
    /// `(u z, v z, z)` from a point in the world.
    pub(crate) projection: Matrix3<f64>,
    pub(crate) offset: Vector3<f64>,
    pub(crate) voxel_size: f64,
    /// Voxels are touched this far in front of a surface, from the one (behind it: `-μ`) to the other, metres.
    pub(crate) reach: [f32; 2],
    /// Free space beside rims is known from the one (behind them) to the other in front, metres.
    pub(crate) rim_reach: [f32; 2],
    /// Half a voxel, metres.
    pub(crate) half_voxel: f32,
    /// A pixel's width at a metre, metres.
    pub(crate) pixel: f32,
    /// Steps of the stored distance per metre.
    pub(crate) per_metre: f32,
    /// In steps of the stored distance.
    pub(crate) colour_reach: f32,
    width: i32,
    /// The last column and the last row.
    last: [f32; 2],
}

impl<'a> Frame<'a> {
    pub(crate) fn new(
        plane_image: &'a PlaneImage,
        intrinsics: &Intrinsics,
        colour: Option<&'a ColourView<'a>>,
        world_from_camera: &Isometry3<f64>,
        settings: &Settings,
    ) -> Self {
        let k = intrinsics;
        let pixels_from_camera = Matrix3::new(k.fx, 0.0, k.cx, 0.0, k.fy, k.cy, 0.0, 0.0, 1.0);
        let camera_from_world = world_from_camera.inverse();
        Self {
            plane_image,
            colour: colour.map(|view| ColourSource::new(view, k, plane_image)),
            projection: pixels_from_camera * camera_from_world.rotation.to_rotation_matrix().into_inner(),
            offset: pixels_from_camera * camera_from_world.translation.vector,
            voxel_size: settings.voxel_size,
            reach: [-settings.truncation(), settings.front()].map(|reach| reach as f32),
            rim_reach: rims::reach(settings),
            half_voxel: (0.5 * settings.voxel_size) as f32,
            pixel: (1.0 / k.fx.abs().max(k.fy.abs())) as f32,
            per_metre: (f64::from(ONE) / settings.truncation()) as f32,
            width: plane_image.width as i32,
            last: [plane_image.width, plane_image.height].map(|side| (side - 1) as f32),
            colour_reach: (f64::from(ONE) * COLOUR_REACH / settings.truncation_voxels) as f32,
        }
    }

    /// Checks a frame and fits its planes, for the processor and the GPU alike.
    pub(crate) fn read(
        plane_image: &'a mut PlaneImage,
        depth: &DepthView,
        colour: Option<&'a ColourView<'a>>,
        world_from_camera: &Isometry3<f64>,
        settings: &Settings,
    ) -> Result<Self, Error> {
        depth.check()?;
        if let Some(colour) = colour {
            colour.check()?;
        }
        check_pose(world_from_camera)?;
        plane_image.read(depth, world_from_camera, settings)?;
        Ok(Self::new(plane_image, &depth.intrinsics, colour, world_from_camera, settings))
    }

    /// Adds the frame to a block, or takes it out. What is touched, and by how much, depends on the frame only.
    pub(crate) fn apply(&self, operation: Operation, key: BlockKey, block: &mut VoxelBlock) -> UpdateCount {
        widest::run(BlockUpdate { frame: self, operation, key, block })
    }

    /// `(u z, v z, z)` of the first voxel of a block.
    pub(crate) fn start(&self, key: BlockKey) -> Vector3<f32> {
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
    ///                -μ scaled_omega <= offset - own, or the voxel is not touched
    ///                within = offset - own <= front scaled_omega
    ///                rim = rims[i + width j]
    ///                beside = there is a rim, -behind <= rim.depth - p.z <= before
    ///                within or beside, or the voxel is not touched
    ///                du = u - i;  dv = v - j
    ///                q = offset - p.z (scaled_omega + (slope_u du + slope_v dv))
    ///                coloured = within, |q| < reach
    ///                if beside, q = min(q, max((rim.pixels - 1/2) pixel rim.depth - h/2, rim.depth - p.z, 0) per_metre)
    ///                q = round(min(max(q, -32767), 32767))
    ///                w = the last four bits of slope_v
    ///                w = round(max(w + w min(q + full, 0) fading, 1))
    ///                S += w q;  W += w                               in integers
    /// ```
    ///
    /// What is behind a surface may be in front of another that this frame does not see: it weighs less the deeper it is.
    ///
    /// `front` is `μ`, or the distance that is carved if that is larger. `start` and the steps are computed in double precision and rounded once.
    #[inline(always)]
    fn update<const INTEGRATE: bool>(&self, key: BlockKey, block: &mut VoxelBlock) -> UpdateCount {
        let (start, step) = (self.start(key), self.step());
        let steps = [0, 1, 2].map(|axis| step.column(axis).into_owned());
        let Some(bounds) = BlockBounds::under(self.plane_image, self.reach, self.rim_reach, &start, &steps) else {
            return UpdateCount::default();
        };
        if bounds.rims[0] <= bounds.rims[1] {
            self.update_rows::<INTEGRATE, true>(block, &start, &steps, &bounds)
        } else {
            self.update_rows::<INTEGRATE, false>(block, &start, &steps, &bounds)
        }
    }

    #[inline(always)]
    fn update_rows<const INTEGRATE: bool, const RIMS: bool>(
        &self,
        block: &mut VoxelBlock,
        start: &Vector3<f32>,
        steps: &[Vector3<f32>; 3],
        bounds: &BlockBounds,
    ) -> UpdateCount {
        let [sx, sy, sz] = steps;
        let offsets = RowOffsets::new(sx);
        let end = offsets.depth[LANES - 1];
        let ([least, most], ends) = (bounds.bounds, [min(end, 0.0), max(end, 0.0)]);
        let mut counts = LaneCounts::default();
        for z in 0..SIDE {
            let (mut rows, mut near, mut beside) = ([[0.0; SIDE]; 3], [0; SIDE], [0; SIDE]);
            for y in 0..SIDE {
                for k in 0..3 {
                    rows[k][y] = (start[k] + sy[k] * y as f32) + sz[k] * z as f32;
                }
                let along = bounds.start + bounds.step[1] * y as f32 + bounds.step[2] * z as f32;
                near[y] = mask(along >= least) & mask(along <= most);
                let depth = rows[2][y];
                beside[y] = mask(depth + ends[1] >= bounds.rims[0]) & mask(depth + ends[0] <= bounds.rims[1]);
            }
            for y in 0..SIDE {
                let (near, beside) = (near[y] != 0, RIMS && beside[y] != 0);
                if near || beside {
                    let lanes = self.project(rows.map(|row| row[y]), &offsets);
                    if !near && lanes.index.iter().all(|&pixel| self.plane_image.rims.rims[pixel as usize] == Rim::NONE)
                    {
                        continue;
                    }
                    if beside {
                        self.accumulate::<INTEGRATE, RIMS>(block, y + SIDE * z, &lanes, &mut counts);
                    } else {
                        self.accumulate::<INTEGRATE, false>(block, y + SIDE * z, &lanes, &mut counts);
                    }
                }
            }
        }
        counts.count()
    }

    #[inline(always)]
    fn project(&self, row: [f32; 3], offsets: &RowOffsets) -> ProjectedVoxels {
        let zero = [0.0; LANES];
        let mut out = ProjectedVoxels {
            inside: [0; LANES],
            index: [0; LANES],
            depth: zero,
            u: zero,
            v: zero,
            du: zero,
            dv: zero,
        };
        for x in 0..LANES {
            let z = row[2] + offsets.depth[x];
            let inverse = 1.0 / z;
            let u = (row[0] + offsets.u[x]) * inverse;
            let v = (row[1] + offsets.v[x]) * inverse;
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

    /// Whether it is known how far a voxel at a depth is from the rim that its pixel passes, and how far, in steps of the
    /// stored distance.
    #[inline(always)]
    fn beside(&self, rim: Rim, depth: f32) -> (i32, f32) {
        let ahead = rim.depth() - depth;
        let known = mask(rim != Rim::NONE) & mask(ahead >= self.rim_reach[0]) & mask(ahead <= self.rim_reach[1]);
        // The rim is between two pixels.
        let aside = (rim.pixels() as i32 as f32 - 0.5) * self.pixel * rim.depth();
        (known, max(max(aside - self.half_voxel, ahead), 0.0) * self.per_metre)
    }

    /// Updates a row of voxels.
    #[inline(always)]
    fn accumulate<const INTEGRATE: bool, const RIMS: bool>(
        &self,
        block: &mut VoxelBlock,
        row: usize,
        lanes: &ProjectedVoxels,
        counts: &mut LaneCounts,
    ) {
        let planes = lanes.index.map(|index| &self.plane_image.planes[index.cast_unsigned() as usize]);
        let [mut offset, mut omega, mut slope_u, mut slope_v] = [[0.0; LANES]; 4];
        for x in 0..LANES {
            (offset[x], omega[x]) = (planes[x].offset, planes[x].scaled_omega);
        }
        let (mut touched, mut own) = ([0; LANES], [0; LANES]);
        for x in 0..LANES {
            // A NaN fails, and so does an omega of 0.
            let ahead = offset[x] - lanes.depth[x] * omega[x];
            let within = mask(ahead >= self.reach[0] * omega[x]) & mask(ahead <= self.reach[1] * omega[x]);
            own[x] = within & lanes.inside[x];
            touched[x] = own[x];
        }
        let mut beside = [f32::INFINITY; LANES];
        if RIMS {
            let mut rims = [Rim::NONE; LANES];
            for (rim, &index) in rims.iter_mut().zip(&lanes.index) {
                *rim = self.plane_image.rims.rims[index as usize];
            }
            for x in 0..LANES {
                let in_front = mask(offset[x] - lanes.depth[x] * omega[x] >= self.reach[0] * omega[x]);
                let (known, distance) = self.beside(rims[x], lanes.depth[x]);
                beside[x] = if known != 0 { distance } else { f32::INFINITY };
                touched[x] |= known & in_front & lanes.inside[x];
            }
        }
        if touched == [0; LANES] {
            return;
        }
        // Most rows end before this.
        for x in 0..LANES {
            [slope_u[x], slope_v[x]] = planes[x].scaled_slope;
        }
        let sums = &mut block.distance.as_chunks_mut::<LANES>().0[row];
        let totals = &mut block.weight.as_chunks_mut::<LANES>().0[row];
        let (mut coloured, mut weights, mut products) = ([0; LANES], [0; LANES], [0; LANES]);
        for x in 0..LANES {
            let at_voxel = omega[x] + (slope_u[x] * lanes.du[x] + slope_v[x] * lanes.dv[x]);
            let q = offset[x] - lanes.depth[x] * at_voxel;
            coloured[x] = mask(q.abs() < self.colour_reach) & own[x];
            let q = if RIMS { min(beside[x], q) } else { q };
            let q = min(max(q, -LIMIT), LIMIT);
            let q = (q + ROUNDER) - ROUNDER;
            // Integers below 2^22 and a power of two: all of it is exact until it is rounded.
            let seen = (slope_v[x].to_bits().cast_signed() & 15) as f32;
            let left = seen + seen * min(q + FULL, 0.0) * FADING;
            let weight = rounded(max(left, 1.0));
            weights[x] = weight & touched[x];
            products[x] = rounded(q * weight as f32) & touched[x];
        }
        let mut counters = [0; LANES];
        for x in 0..LANES {
            let (sum, total) = if INTEGRATE {
                (sums[x].wrapping_add(products[x]), i32::from(totals[x]) + weights[x])
            } else {
                (sums[x].wrapping_sub(products[x]), i32::from(totals[x]) - weights[x])
            };
            sums[x] = sum;
            totals[x] = total as u16;
            counters[x] = total;
            if !INTEGRATE {
                // No sum of observations can leave `-32767 W..=32767 W`: what was taken out was not in.
                let most = (total << 15).wrapping_sub(total);
                counters[x] |= most.wrapping_sub(sum.wrapping_abs()) & i32::MIN & touched[x];
            }
        }
        for x in 0..LANES {
            counts.counters[x] |= counters[x];
            counts.touched[x] -= touched[x];
        }
        if let Some(colour) = self.colour.as_ref().filter(|_| coloured != [0; LANES]) {
            for (x, &near) in coloured.iter().enumerate() {
                if near != 0
                    && let Some(rgb) = colour.at(lanes, x)
                {
                    counts.colour_overflow |= accumulate_colour::<INTEGRATE>(&mut block.colour[LANES * row + x], rgb);
                }
            }
        }
    }
}

/// A frame on its way into a block, or out of it.
struct BlockUpdate<'a> {
    frame: &'a Frame<'a>,
    operation: Operation,
    key: BlockKey,
    block: &'a mut VoxelBlock,
}

impl Work for BlockUpdate<'_> {
    type Output = UpdateCount;

    #[inline(always)]
    fn run(self) -> UpdateCount {
        match self.operation {
            Operation::Integrate => self.frame.update::<true>(self.key, self.block),
            Operation::Deintegrate => self.frame.update::<false>(self.key, self.block),
        }
    }
}

/// Weights start to fall so many steps of the stored distance behind a surface (ours: `μ / 8`, half a voxel of four to `μ`): a weight that
/// goes with the noise of its own distance would shift the mean.
const FULL: f32 = 4096.0;
/// By so much a step from there on (ours: they are at the least by `0.4 μ`). What is in front of a thing on one side is behind it from the
/// other: with equal weights, one that is thinner than `μ` would vanish between its two sides.
const FADING: f32 = 7.0 / 65536.0;
/// Largest stored distance of one observation.
const LIMIT: f32 = ONE as f32;

/// What the update of a block counts, per lane.
#[derive(Default)]
struct LaneCounts {
    touched: [i32; LANES],
    /// All counters: they ran over or under if there is a bit beyond the sixteenth.
    counters: [i32; LANES],
    colour_overflow: bool,
}

impl LaneCounts {
    fn count(&self) -> UpdateCount {
        let voxels = self.touched.iter().sum::<i32>().unsigned_abs() as usize;
        UpdateCount { voxels, overflow: self.colour_overflow || self.counters.iter().any(|bits| bits >> 16 != 0) }
    }
}
