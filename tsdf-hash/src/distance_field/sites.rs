//! The sites of one block.

use crate::blocks::sign_bits::SignBits;
use crate::blocks::voxel_block::{SIDE, VOXELS, VoxelBlock};

/// From a voxel to the next along an axis.
const STRIDE: [usize; 3] = [1, SIDE, SIDE * SIDE];

/// The sites of a block, and where they are.
#[derive(Default)]
pub(crate) struct BlockSites {
    /// Voxels from the centre of the first voxel of the block, `0..=8`.
    pub(crate) sites: Vec<[f32; 3]>,
    /// The box around them.
    pub(crate) low: [f32; 3],
    pub(crate) high: [f32; 3],
}

impl BlockSites {
    pub(crate) fn fill(&mut self, sites: impl Iterator<Item = [f32; 3]>) {
        self.sites.clear();
        self.sites.extend(sites);
        let bound = |start: f32, pick: fn(f32, f32) -> f32| {
            self.sites.iter().fold([start; 3], |all, site| [0, 1, 2].map(|k| pick(all[k], site[k])))
        };
        (self.low, self.high) = (bound(f32::INFINITY, f32::min), bound(f32::NEG_INFINITY, f32::max));
    }
}

/// The lower voxel of an edge that crosses the surface.
#[derive(Clone, Copy)]
pub(crate) struct CutEdge {
    axis: usize,
    voxel: usize,
}

impl CutEdge {
    /// Lists the edges of a block that cross the surface; `upper` are the blocks above along x, y and z. Returns which of
    /// the four blocks they touch: bit 0 itself, then the upper ones.
    pub(crate) fn list(signs: &SignBits, upper: &[SignBits; 3], edges: &mut Vec<Self>) -> u8 {
        edges.clear();
        let mut touched = 0;
        signs.crossings(upper, |axis, voxel| {
            let edge = Self { axis, voxel };
            touched |= 1 | 1 << edge.end().0;
            edges.push(edge);
        });
        touched
    }

    /// Which of the four blocks the upper voxel is in, and its number there.
    fn end(self) -> (usize, usize) {
        let stride = STRIDE[self.axis];
        if self.voxel / stride % SIDE < SIDE - 1 {
            return (0, self.voxel + stride);
        }
        (self.axis + 1, (self.voxel + stride + VOXELS - SIDE * stride) % VOXELS)
    }

    /// Where the distance, interpolated along the edge, is zero.
    pub(crate) fn site(self, blocks: &[&VoxelBlock; 4]) -> [f32; 3] {
        let (upper, other) = self.end();
        let ends = [(blocks[0], self.voxel), (blocks[upper], other)];
        // The ratio of means by the ratio of sums, whose difference is exact: t = a / (a - b).
        let [(s0, w0), (s1, w1)] = ends.map(|(block, k)| (i64::from(block.distance[k]), i64::from(block.weight[k])));
        let (a, b) = (s0 * w1, s1 * w0);
        let mut site = STRIDE.map(|stride| (self.voxel / stride % SIDE) as f32);
        site[self.axis] += (a as f64 / (a - b) as f64) as f32;
        site
    }
}
