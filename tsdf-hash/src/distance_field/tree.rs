//! Which blocks hold sites, as a tree: every cell has 4³ children and a bit for each of them that is not empty.

use crate::blocks::block_key::BlockKey;
use crate::blocks::block_table::BlockTable;

/// Cells of the eleventh level are wider than the range of the keys.
const MOST_LEVELS: usize = 11;

/// Children of level 0 are blocks, those of level `l` the cells of level `l - 1`.
#[derive(Default)]
pub(crate) struct Tree {
    levels: Vec<BlockTable<u64>>,
}

impl Tree {
    /// With top cells wider than `width` blocks, clearly, so that rounding cannot make a ball of this width touch three of
    /// them along an axis.
    pub(crate) fn new(width: f64) -> Self {
        let mut count = 1;
        while count < MOST_LEVELS && f64::from(1 << (2 * count)) < 1.001 * width {
            count += 1;
        }
        Self { levels: (0..count).map(|_| BlockTable::new()).collect() }
    }

    pub(crate) fn height(&self) -> usize {
        self.levels.len()
    }

    /// The children of a cell that are not empty, bit `x + 4 (y + 4 z)`.
    pub(crate) fn children(&self, level: usize, cell: BlockKey) -> u64 {
        self.levels[level].get(cell).copied().unwrap_or(0)
    }

    /// Adds a block, or takes it away.
    pub(crate) fn set(&mut self, block: BlockKey, full: bool) {
        let mut child = block.block();
        for level in &mut self.levels {
            let bit = 1 << (child[0] & 3 | (child[1] & 3) << 2 | (child[2] & 3) << 4);
            child = child.map(|c| c >> 2);
            let Some(cell) = BlockKey::new(child) else { return };
            let old = level.get(cell).copied().unwrap_or(0);
            let new = if full { old | bit } else { old & !bit };
            match level.get_mut(cell) {
                Some(mask) if new != 0 => *mask = new,
                Some(_) => drop(level.remove(cell)),
                None if new != 0 => level.insert(cell, new),
                None => {}
            }
            // Above, nothing changes unless the cell has just been filled or emptied.
            if (old == 0) == (new == 0) {
                return;
            }
        }
    }
}
