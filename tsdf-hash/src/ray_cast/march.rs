//! Eight neighbouring rays at a time, through the blocks of their square.
//!
//! One ray is a chain: where it is, what is there, where it goes next; the processor waits for each link. Eight of them in step
//! fill the waits, and most of their arithmetic is done in vectors.
//!
//! Only additions, subtractions, multiplications, divisions, square roots, comparisons and integers, for each ray in the
//! order in which they are written: the result is the same on every processor that rounds as IEEE 754 asks.

use crate::ray_cast::camera::Camera;
use crate::ray_cast::cell::Cell;
use crate::ray_cast::lanes::{Cells, LANES, Lanes, flags, lanes, set};
use crate::ray_cast::pixel::{Band, Pixel, UNSEEN};
use crate::ray_cast::tiles::{self, Tiles};
use crate::ray_cast::unpacked::{UnpackedBlock, UnpackedBlocks, VisibleBlock};
use crate::rounding::{max, min};

/// A ray parallel to a plane of voxels still has a finite inverse, voxels per metre.
pub(crate) const MIN_SLOPE: f32 = 1e-6;
/// A block that starts this little below zero is met at its border: rounding, in truncation distances.
pub(crate) const GRAZING_TOLERANCE: f32 = 1e-3;
/// Steps near the surface and in unobserved cells, voxels.
pub(crate) const MIN_STEP: f32 = 0.5;

// One row of a square is one group of rays.
const _: () = assert!(tiles::SIDE == LANES);

/// Fills the rows of a band.
pub(crate) fn fill(band: &mut Band, camera: &Camera, blocks: &UnpackedBlocks, tiles: &Tiles, colour: bool) {
    let width = camera.width;
    let rows = band.depth.len() / width;
    for top in (0..rows).step_by(tiles::SIDE) {
        for left in (0..width).step_by(tiles::SIDE) {
            let list = tiles.list(left / tiles::SIDE, (band.first + top) / tiles::SIDE);
            for row in top..(top + tiles::SIDE).min(rows) {
                let rays = Rays::new(camera, band.first + row, left);
                let wanted = (width - left).min(LANES);
                for (lane, pixel) in rays.cast(wanted, blocks, list, colour)[..wanted].iter().enumerate() {
                    band.set(row * width + left + lane, pixel);
                }
            }
        }
    }
}

/// Rays of neighbouring pixels of a row.
struct Rays<'a> {
    camera: &'a Camera,
    /// Voxels per metre of depth.
    direction: [Lanes; 3],
    inverse: [Lanes; 3],
    /// Metres of depth per voxel along the ray.
    per_voxel: Lanes,
}

impl<'a> Rays<'a> {
    fn new(camera: &'a Camera, row: usize, left: usize) -> Self {
        let (start, step) = camera.row(row);
        let direction = [0, 1, 2].map(|k| lanes(|n| start[k] + step[k] * (left + n) as f32));
        let inverse = direction.map(|d| lanes(|n| 1.0 / if d[n].abs() < MIN_SLOPE { MIN_SLOPE } else { d[n] }));
        let [dx, dy, dz] = direction;
        let per_voxel = lanes(|n| 1.0 / (dx[n] * dx[n] + dy[n] * dy[n] + dz[n] * dz[n]).sqrt());
        Self { camera, direction, inverse, per_voxel }
    }

    /// What the first `wanted` rays meet.
    fn cast(&self, wanted: usize, blocks: &UnpackedBlocks, list: &[u32], colour: bool) -> [Pixel; LANES] {
        let mut pixels = [Pixel::NONE; LANES];
        let mut active = u8::MAX >> (LANES - wanted);
        for &k in list {
            let visible = &blocks.visible[k as usize];
            let (enter, leave) = self.crossing(visible);
            let inside = flags(|n| enter[n] <= leave[n]) & active;
            if inside != 0 {
                let block = &blocks.blocks[visible.block];
                let within = Within { rays: self, origin: &visible.origin, block, colour };
                active &= !within.march(inside, enter, &leave, &mut pixels);
                if active == 0 {
                    break;
                }
            }
        }
        pixels
    }

    /// Depths between which the rays are in the box of a visible.
    #[inline(always)]
    fn crossing(&self, visible: &VisibleBlock) -> (Lanes, Lanes) {
        let (mut enter, mut leave) = ([self.camera.min_depth; LANES], [self.camera.max_depth; LANES]);
        for k in 0..3 {
            for n in 0..LANES {
                let (a, b) = (visible.low[k] * self.inverse[k][n], visible.high[k] * self.inverse[k][n]);
                enter[n] = max(enter[n], min(a, b));
                leave[n] = min(leave[n], max(a, b));
            }
        }
        (enter, leave)
    }
}

/// Rays in the nodes of a block.
struct Within<'a> {
    rays: &'a Rays<'a>,
    block: &'a UnpackedBlock,
    /// The camera, from the first node.
    origin: &'a [f32; 3],
    colour: bool,
}

impl Within<'_> {
    /// Moves the rays of the set `inside` from `t` to `leave`, depths in metres. Returns those that end here: at a surface, whose
    /// pixel is then set, or at the solid met from a side where no distance was observed.
    #[inline(always)]
    fn march(&self, mut inside: u8, mut t: Lanes, leave: &Lanes, pixels: &mut [Pixel; LANES]) -> u8 {
        let reach = self.rays.camera.truncation;
        let mut ended = 0;
        // The step before: its depth, and its value where that was outside, else NaN.
        let (mut near, mut above) = ([0.0; LANES], [f32::NAN; LANES]);
        loop {
            let cells = self.cells(&t);
            let mut value = [0.0; LANES];
            for n in set(inside) {
                // Not in vectors: eight corners from eight visible each would go through memory twice.
                value[n] = cells.cell(n).value(&self.block.distance);
            }
            let solid = flags(|n| value[n] < 0.0) & inside;
            for n in set(solid) {
                let before = if !above[n].is_nan() {
                    (near[n], above[n])
                } else if value[n] > -GRAZING_TOLERANCE {
                    (t[n], 0.0)
                } else {
                    continue;
                };
                if let Some(pixel) = self.refine(n, before, (t[n], value[n])) {
                    pixels[n] = pixel;
                }
            }
            ended |= solid;
            inside &= !(solid | flags(|n| t[n] >= leave[n]));
            if inside == 0 {
                return ended;
            }
            (near, above) = (t, value);
            t = lanes(|n| {
                // Of a NaN the maximum is the other.
                let step = max(value[n] * reach, MIN_STEP);
                min(t[n] + step * self.rays.per_voxel[n], leave[n])
            });
        }
    }

    #[inline(always)]
    fn cells(&self, t: &Lanes) -> Cells {
        Cells::at([0, 1, 2].map(|k| lanes(|n| self.origin[k] + self.rays.direction[k][n] * t[n])))
    }

    /// From two depths of a ray on either side of the surface: one step of the secant, one of Newton.
    #[inline(always)]
    fn refine(&self, lane: usize, (near, above): (f32, f32), (far, below): (f32, f32)) -> Option<Pixel> {
        let t = near + (far - near) * (above / (above - below));
        let [dx, dy, dz] = self.rays.direction.map(|d| d[lane]);
        let [x, y, z] = *self.origin;
        let cell = Cell::at([x + dx * t, y + dy * t, z + dz * t]);
        let (value, [gx, gy, gz]) = cell.value_and_gradient(&self.block.distance);
        let slope = gx * dx + gy * dy + gz * dz;
        // Otherwise a back face, or a NaN: the voxel at the hit is not observed.
        (slope < 0.0).then(|| {
            let reach = MIN_STEP * self.rays.per_voxel[lane];
            let depth = t + min(max(-value / slope, -reach), reach);
            let scale = 1.0 / (gx * gx + gy * gy + gz * gz).sqrt();
            let colour = if self.colour { cell.colour(&self.block.colour) } else { UNSEEN };
            let weight = self.block.weight[cell.nearest()];
            Pixel { depth, normal: [gx * scale, gy * scale, gz * scale], colour, weight }
        })
    }
}
