//! The marching-cubes case of every cell of a block, 8 cells at a time.

use crate::blocks::sign_bits::SignBits;
use crate::blocks::voxel_block::SIDE;

/// The voxels of a block and the first ones of the blocks above it, 9³ in all, a word per row along x.
#[derive(Default)]
pub(crate) struct CornerRows {
    observed: [[u16; SIDE + 1]; SIDE + 1],
    solid: [[u16; SIDE + 1]; SIDE + 1],
}

impl CornerRows {
    /// Entry `n` is the block at `+1` along x (bit 0), y (bit 1), z (bit 2).
    pub(crate) fn with_border(blocks: &[Option<SignBits>; 8]) -> Self {
        let mut rows = Self::default();
        for (n, signs) in blocks.iter().enumerate() {
            let Some(signs) = signs else { continue };
            // Along an axis in which the neighbour lies above, only its first layer is taken, as the ninth.
            let (mask, shift) = if n & 1 == 1 { (1_u16, SIDE) } else { (0xff, 0) };
            let layers = |axis: usize| if n >> axis & 1 == 1 { (SIDE, 1) } else { (0, SIDE) };
            let ((z0, zs), (y0, ys)) = (layers(2), layers(1));
            for z in 0..zs {
                for y in 0..ys {
                    rows.observed[z0 + z][y0 + y] |= ((signs.observed[z] >> (SIDE * y)) as u16 & mask) << shift;
                    rows.solid[z0 + z][y0 + y] |= ((signs.solid[z] >> (SIDE * y)) as u16 & mask) << shift;
                }
            }
        }
        rows
    }

    /// Calls `found` with the lowest corner and the case of every cell whose eight corners are observed and not all on one
    /// side.
    pub(crate) fn crossed(&self, mut found: impl FnMut([usize; 3], u8)) {
        for z in 0..SIDE {
            for y in 0..SIDE {
                let four = |rows: &[[u16; SIDE + 1]; SIDE + 1]| {
                    [rows[z][y], rows[z][y + 1], rows[z + 1][y], rows[z + 1][y + 1]]
                };
                let (observed, solid) = (four(&self.observed), four(&self.solid));
                let all = |rows: [u16; 4]| rows.iter().fold(0x1ff, |a, b| a & b);
                let any = solid.iter().fold(0, |a, b| a | b);
                let seen = all(observed) & all(observed) >> 1;
                let mut cells = seen & (any | any >> 1) & !(all(solid) & all(solid) >> 1) & 0xff;
                while cells != 0 {
                    let x = cells.trailing_zeros() as usize;
                    cells &= cells - 1;
                    // Corner pairs (y, z) = (0, 0), (1, 0), (0, 1), (1, 1) fill two bits of the case each.
                    let case = (0..4).fold(0, |case, k| case | (solid[k] >> x & 3) << (2 * k)) as u8;
                    found([x, y, z], case);
                }
            }
        }
    }
}
