//! Which voxels of a block are observed and which are behind the surface, a bit each: 64 voxels at a time.

use crate::blocks::voxel_block::{SIDE, VoxelBlock};

/// The last voxel of each row along x.
const LAST: u64 = 0x8080_8080_8080_8080;

/// A word per layer along z, bit `x + 8 y`. A voxel is solid if its distance is negative.
#[derive(Clone, Copy, Default, PartialEq)]
pub(crate) struct SignBits {
    pub(crate) observed: [u64; SIDE],
    pub(crate) solid: [u64; SIDE],
}

impl SignBits {
    pub(crate) const NONE: Self = Self { observed: [0; SIDE], solid: [0; SIDE] };

    pub(crate) fn of(block: &VoxelBlock) -> Self {
        let mut signs = Self::NONE;
        let (weights, distances) = (block.weight.as_chunks::<SIDE>().0, block.distance.as_chunks::<SIDE>().0);
        for (row, (weights, distances)) in weights.iter().zip(distances).enumerate() {
            let (mut observed, mut solid) = (0_u16, 0_u32);
            for x in 0..SIDE {
                observed |= if weights[x] > 0 { 1 << x } else { 0 };
                solid |= if distances[x] < 0 { 1 << x } else { 0 };
            }
            let (layer, shift) = (row / SIDE, row % SIDE * SIDE);
            signs.observed[layer] |= u64::from(observed) << shift;
            signs.solid[layer] |= u64::from(solid) << shift;
        }
        signs
    }

    /// Calls `found` with the axis and the lower voxel of every edge between two observed voxels on different sides;
    /// `upper` are the blocks above along x, y and z.
    pub(crate) fn crossings(&self, upper: &[Self; 3], mut found: impl FnMut(usize, usize)) {
        let next = |axis: usize, layer: usize, pick: fn(&Self) -> &[u64; SIDE]| {
            let (own, above) = (pick(self), pick(&upper[axis]));
            match axis {
                0 => own[layer] >> 1 & !LAST | above[layer] << (SIDE - 1) & LAST,
                1 => own[layer] >> SIDE | above[layer] << (SIDE * (SIDE - 1)),
                _ => *own.get(layer + 1).unwrap_or(&above[0]),
            }
        };
        for layer in 0..SIDE {
            for axis in 0..3 {
                let observed = self.observed[layer] & next(axis, layer, |signs| &signs.observed);
                let mut edges = observed & (self.solid[layer] ^ next(axis, layer, |signs| &signs.solid));
                while edges != 0 {
                    found(axis, layer * SIDE * SIDE + edges.trailing_zeros() as usize);
                    edges &= edges - 1;
                }
            }
        }
    }
}
