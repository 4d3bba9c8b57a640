//! Where in a block voxels can be touched: a bound that spares work and never changes the map.

use nalgebra::Vector3;

use crate::blocks::voxel_block::SIDE;
use crate::integration::plane_image::PlaneImage;
use crate::integration::plane_tile::{Linear, NO_RIMS, TILE, Tile};
use crate::integration::voxel_lanes::LANES;
use crate::rounding::{max, min};

/// Blocks closer to the camera's plane are searched voxel by voxel, metres.
const NEAREST: f32 = 1e-2;

/// The voxels where a linear function of their indices is between two limits.
pub(crate) struct BlockBounds {
    pub(crate) start: f32,
    pub(crate) step: [f32; 3],
    /// The function at the first voxel of a row that can be in the slab.
    pub(crate) bounds: [f32; 2],
    /// Depths that voxels beside rims have, metres; the second below the first if there are none.
    pub(crate) rims: [f32; 2],
}

impl BlockBounds {
    const ALL: Self =
        Self { start: 0.0, step: [0.0; 3], bounds: [-1.0, 1.0], rims: [f32::NEG_INFINITY, f32::INFINITY] };

    /// Where in a block voxels can be touched, from the squares of pixels that it projects to; `None` if nowhere.
    ///
    /// If the inverse depth under the block is a linear function of the pixel, `1 - z ω` is one of the voxel. A voxel is
    /// touched if that is between `-μ ω` and `front ω`; an inverse depth that is `e` off the function adds `z e`, on its side.
    #[inline(always)]
    pub(crate) fn under(
        surface: &PlaneImage,
        reach: [f32; 2],
        rim_reach: [f32; 2],
        start: &Vector3<f32>,
        steps: &[Vector3<f32>; 3],
    ) -> Option<Self> {
        let (mut low, mut high) = ([f32::INFINITY; 2], [f32::NEG_INFINITY; 2]);
        let (mut near, mut far) = (f32::INFINITY, 0.0_f32);
        for corner in 0..8 {
            let at = |axis: usize| steps[axis] * if corner >> axis & 1 == 1 { (SIDE - 1) as f32 } else { 0.0 };
            let p = start + at(0) + at(1) + at(2);
            if p.z < NEAREST {
                return Some(Self::ALL);
            }
            (near, far) = (min(near, p.z), max(far, p.z));
            for k in 0..2 {
                let pixel = p[k] / p.z;
                low[k] = min(low[k], pixel);
                high[k] = max(high[k], pixel);
            }
        }
        let sides = [surface.width, surface.height];
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
        let line = |line: usize| &surface.tiles[line * across + columns.0..=line * across + columns.1];
        // What is too far in front of all voxels or behind them touches none.
        let depths = [near + 1.001 * reach[0], far + 1.001 * reach[1]];
        let matters = |tile: &Tile| tile.far >= depths[0] && tile.near <= depths[1];
        // The tile with the least error stands for all.
        let (mut omega, mut least, mut rims) = (Linear::default(), f32::INFINITY, NO_RIMS);
        for k in lines.0..=lines.1 {
            for tile in line(k) {
                rims = [min(rims[0], tile.rims[0]), max(rims[1], tile.rims[1])];
                if matters(tile) && tile.error < least {
                    (omega, least) = (tile.omega, tile.error);
                }
            }
        }
        if least == f32::INFINITY && rims[1] < rims[0] {
            return None;
        }
        let (mut error, mut nearest) = ([f32::INFINITY, f32::NEG_INFINITY], f32::INFINITY);
        for k in lines.0..=lines.1 {
            for (column, tile) in (columns.0..).zip(line(k)) {
                if matters(tile) {
                    let off = tile.off(&omega, [column, k]);
                    error = [min(error[0], off[0]), max(error[1], off[1])];
                    nearest = min(nearest, tile.near);
                }
            }
        }
        let along = |p: &Vector3<f32>| omega.base * p.z + omega.slope[0] * p.x + omega.slope[1] * p.y;
        // Half a pixel between a voxel's projection and its pixel; and a little for the rounding.
        let half = 0.5 * (omega.slope[0].abs() + omega.slope[1].abs());
        let error = [error[0] - half, error[1] + half];
        let reach = [
            reach[0] / nearest + error[0] * if error[0] < 0.0 { far } else { near },
            reach[1] / nearest + error[1] * if error[1] > 0.0 { far } else { near },
        ];
        let reach = [reach[0] - 1e-3 * reach[0].abs() - 1e-4, reach[1] + 1e-3 * reach[1].abs() + 1e-4];
        let rims = [rims[0] - 1.001 * rim_reach[1], rims[1] - 1.001 * rim_reach[0]];
        Some(Self::new(1.0 - along(start), [0, 1, 2].map(|k| -along(&steps[k])), reach, rims))
    }

    fn new(start: f32, step: [f32; 3], [least, most]: [f32; 2], rims: [f32; 2]) -> Self {
        let end = step[0] * (LANES - 1) as f32;
        let bounds = [least - end.max(0.0), most - end.min(0.0)];
        Self { start, step, bounds, rims }
    }
}
