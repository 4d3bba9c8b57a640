//! The cells that the surface crosses.

use super::cases::Edge;
use super::weld::EdgeSet;
use crate::block::{Block, SIDE};
use crate::key::Key;
use crate::store::Store;

/// No such neighbour.
pub(crate) const NONE: u32 = u32::MAX;

/// A block and the blocks above it.
pub(crate) struct Neighbourhood {
    pub(crate) key: Key,
    pub(crate) slot: usize,
    /// Position in the list of the block at `+1` along x (bit 0), y (bit 1), z (bit 2); entry 0 is the block itself.
    pub(crate) upper: [u32; 8],
}

/// A cell that the surface crosses; its lowest corner is `voxel` of `block`.
pub(crate) struct Cell {
    pub(crate) block: usize,
    pub(crate) voxel: [usize; 3],
    pub(crate) case: u8,
}

/// All of them, in the order of the block coordinates.
pub(crate) struct Cells {
    pub(crate) blocks: Vec<Neighbourhood>,
    /// Position of the block, index of the voxel and case.
    active: Vec<(u32, u16, u8)>,
}

impl Cells {
    pub(crate) fn find(store: &Store) -> Self {
        let keys = store.sorted_keys();
        let mut position = vec![NONE; keys.len()];
        for (k, slot) in keys.iter().enumerate().filter_map(|(k, &key)| Some((k, store.slot(key)?))) {
            position[slot] = k as u32;
        }
        let blocks: Vec<_> = keys
            .iter()
            .map(|&key| {
                let slot_of = |n: i32| store.slot(key.neighbour([n & 1, n >> 1 & 1, n >> 2])?);
                let upper = [0, 1, 2, 3, 4, 5, 6, 7].map(|n| slot_of(n).map_or(NONE, |slot| position[slot]));
                Neighbourhood { key, slot: slot_of(0).unwrap_or_default(), upper }
            })
            .collect();
        let planes: Vec<_> = blocks.iter().map(|b| store.block(b.slot).map(Rows::of).unwrap_or_default()).collect();
        let mut active = Vec::new();
        for (k, block) in blocks.iter().enumerate() {
            Rows::with_border(&planes, &block.upper).crossed(|voxel, case| active.push((k as u32, voxel, case)));
        }
        Self { blocks, active }
    }

    pub(crate) fn len(&self) -> usize {
        self.active.len()
    }

    pub(crate) fn iter(&self) -> impl Iterator<Item = Cell> + '_ {
        self.active.iter().map(|&(block, voxel, case)| {
            let voxel = usize::from(voxel);
            let voxel = [voxel % SIDE, voxel / SIDE % SIDE, voxel / (SIDE * SIDE)];
            Cell { block: block as usize, voxel, case }
        })
    }
}

/// The block that owns an edge of a cell, and the edge's name there.
pub(crate) fn owner(block: &Neighbourhood, cell: [usize; 3], edge: Edge) -> (usize, usize) {
    let mut voxel = cell;
    let mut step = 0;
    for (axis, v) in voxel.iter_mut().enumerate() {
        *v += edge.corner >> axis & 1;
        if *v == SIDE {
            *v = 0;
            step |= 1 << axis;
        }
    }
    (block.upper[step] as usize, EdgeSet::edge(voxel, edge.axis))
}

/// Bits of up to 9³ voxels, a word per row along x: whether they are observed, and whether they are solid.
#[derive(Clone, Default)]
struct Rows {
    observed: [[u16; SIDE + 1]; SIDE + 1],
    solid: [[u16; SIDE + 1]; SIDE + 1],
}

impl Rows {
    fn of(block: &Block) -> Self {
        let mut rows = Self::default();
        for z in 0..SIDE {
            for y in 0..SIDE {
                let start = SIDE * (y + SIDE * z);
                for x in 0..SIDE {
                    rows.observed[z][y] |= u16::from(block.weight[start + x] > 0) << x;
                    rows.solid[z][y] |= u16::from(block.distance[start + x] < 0) << x;
                }
            }
        }
        rows
    }

    /// The rows of a block with the first rows of the blocks above it.
    fn with_border(all: &[Self], upper: &[u32; 8]) -> Self {
        let mut rows = Self::default();
        for (n, &k) in upper.iter().enumerate().filter(|&(_, &k)| k != NONE) {
            let source = &all[k as usize];
            // Along an axis in which the neighbour lies above, only its first layer is taken, as the ninth.
            let range = |axis: usize| if n >> axis & 1 == 1 { SIDE..=SIDE } else { 0..=SIDE - 1 };
            for z in range(2) {
                for y in range(1) {
                    let place = |row: u16| if n & 1 == 1 { (row & 1) << SIDE } else { row };
                    rows.observed[z][y] |= place(source.observed[z % SIDE][y % SIDE]);
                    rows.solid[z][y] |= place(source.solid[z % SIDE][y % SIDE]);
                }
            }
        }
        rows
    }

    /// Calls `found` for every cell whose eight corners are observed and not all on one side.
    fn crossed(&self, mut found: impl FnMut(u16, u8)) {
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
                    found((x + SIDE * (y + SIDE * z)) as u16, case);
                }
            }
        }
    }
}
