//! The nearest site, by branch and bound down the tree.

use std::ops::RangeInclusive;

use crate::blocks::block_key::BlockKey;
use crate::blocks::block_table::BlockTable;
use crate::blocks::voxel_block::SIDE;
use crate::derived_blocks::Derived;
use crate::distance_field::sites::BlockSites;
use crate::distance_field::tree::Tree;

/// Blocks per axis on either side of the origin.
const REACH: i32 = 1 << 20;

/// The nearest site so far. Lattice coordinates: voxel centres are integers, and the sites of block `b` lie in
/// `8 b ..= 8 b + 8`.
pub(crate) struct Search<'a> {
    sites: &'a BlockTable<Derived<BlockSites>>,
    tree: &'a Tree,
    point: [f64; 3],
    /// Squared distance, voxels².
    pub(crate) best: f64,
    /// The point minus the site, voxels.
    pub(crate) offset: Option<[f64; 3]>,
}

impl<'a> Search<'a> {
    /// The nearest site closer than `radius` voxels to a point with finite coordinates.
    pub(crate) fn run(
        sites: &'a BlockTable<Derived<BlockSites>>,
        tree: &'a Tree,
        point: [f64; 3],
        radius: f64,
    ) -> Self {
        let mut search = Self { sites, tree, point, best: radius * radius, offset: None };
        let top = tree.height() - 1;
        // At most two cells along each axis: they are wider than the ball, or there are no more.
        let width = cell_width(top + 1);
        let last = (REACH - 1) >> (2 * (top + 1));
        let ranges = point.map(|c| {
            let cell = |c: f64| (c / width).floor().clamp(f64::from(-last - 1), f64::from(last)) as i32;
            cell(c - radius)..=cell(c + radius)
        });
        // The cell of the point first, so that the others can be passed over.
        let own = point.map(|c| (c / width).floor() as i32);
        let cells = (0..8).map(|n| [0, 1, 2].map(|k| own_cell_first(own[k], &ranges[k], n >> k & 1)));
        for cell in cells {
            if let [Some(x), Some(y), Some(z)] = cell {
                search.descend(top, [x, y, z]);
            }
        }
        search
    }

    /// Searches a cell, its nearest children first.
    fn descend(&mut self, level: usize, cell: [i32; 3]) {
        let Some(key) = BlockKey::new(cell) else { return };
        let mut mask = self.tree.children(level, key);
        if mask == 0 {
            return;
        }
        let gaps = [0, 1, 2].map(|k| self.gaps(k, 4 * cell[k], cell_width(level)));
        let mut order = [(0.0, 0); 64];
        let mut count = 0;
        while mask != 0 {
            let child = mask.trailing_zeros() as usize;
            mask &= mask - 1;
            let bound = gaps[0][child & 3] + gaps[1][child >> 2 & 3] + gaps[2][child >> 4];
            if bound < self.best {
                order[count] = (bound, child);
                count += 1;
            }
        }
        // Ties by number: which of two equally near sites is found must not depend on how the tree came about.
        order[..count].sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        for &(bound, child) in &order[..count] {
            if bound >= self.best {
                return;
            }
            let step = [child & 3, child >> 2 & 3, child >> 4];
            let child = [0, 1, 2].map(|k| 4 * cell[k] + step[k] as i32);
            if level == 0 { self.scan(child) } else { self.descend(level - 1, child) }
        }
    }

    /// Squared distances along an axis from four cells in a row.
    fn gaps(&self, axis: usize, first: i32, width: f64) -> [f64; 4] {
        let along = self.point[axis];
        [0, 1, 2, 3].map(|n| {
            let low = f64::from(first + n) * width;
            let gap = (low - along).max(along - (low + width)).max(0.0);
            gap * gap
        })
    }

    /// Compares with the sites of a block.
    fn scan(&mut self, block: [i32; 3]) {
        let Some(derived) = BlockKey::new(block).and_then(|key| self.sites.get(key)) else { return };
        let in_block = &derived.data;
        let local = [0, 1, 2].map(|k| self.point[k] - f64::from(block[k]) * SIDE as f64);
        let gaps = [0, 1, 2]
            .map(|k| (f64::from(in_block.low[k]) - local[k]).max(local[k] - f64::from(in_block.high[k])).max(0.0));
        if gaps[0] * gaps[0] + gaps[1] * gaps[1] + gaps[2] * gaps[2] >= self.best {
            return;
        }
        for site in &in_block.sites {
            let offset = [0, 1, 2].map(|k| local[k] - f64::from(site[k]));
            let square = offset[0] * offset[0] + offset[1] * offset[1] + offset[2] * offset[2];
            if square < self.best {
                (self.best, self.offset) = (square, Some(offset));
            }
        }
    }
}

/// The first or the second of at most two cells, beginning with the one that the point is in.
fn own_cell_first(own: i32, range: &RangeInclusive<i32>, nth: i32) -> Option<i32> {
    let (first, other) = if own == *range.end() { (range.end(), range.start()) } else { (range.start(), range.end()) };
    if nth == 0 { Some(*first) } else { Some(*other).filter(|other| other != first) }
}

/// Edge of the children of a level, voxels.
fn cell_width(level: usize) -> f64 {
    SIDE as f64 * f64::from(1 << (2 * level))
}
