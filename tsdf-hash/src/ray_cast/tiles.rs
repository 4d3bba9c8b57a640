//! Which blocks each tile of pixels may see.

use crate::ray_cast::camera::Camera;
use crate::ray_cast::unpacked::VisibleBlock;

/// Edge of a tile, pixels.
pub(crate) const SIDE: usize = 8;

/// Lists of visible blocks, front to back, one per tile.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tiles {
    pub(crate) columns: usize,
    /// Where the list of each tile starts, and where the last one ends.
    pub(crate) starts: Vec<u32>,
    pub(crate) lists: Vec<u32>,
}

impl Tiles {
    pub(crate) fn fill(&mut self, blocks: &[VisibleBlock], camera: &Camera) {
        self.columns = camera.width.div_ceil(SIDE);
        let count = self.columns * camera.height.div_ceil(SIDE);
        let covers: Vec<_> = blocks.iter().map(|block| camera.cover(&block.low, &block.high)).collect();
        let columns = self.columns;
        let covered = |cover: &Option<[usize; 4]>| {
            let [left, top, right, bottom] = cover.map_or([1, 1, 0, 0], |pixels| pixels.map(|p| p / SIDE));
            (top..=bottom).flat_map(move |row| (left..=right).map(move |column| row * columns + column))
        };
        self.starts.clear();
        self.starts.resize(count + 1, 0);
        for tile in covers.iter().flat_map(covered) {
            self.starts[tile] += 1;
        }
        let mut end = 0;
        for start in &mut self.starts {
            end += *start;
            *start = end;
        }
        self.lists.clear();
        self.lists.resize(end as usize, 0);
        // Backwards, each list from its end: what was an end is then a start.
        for (block, cover) in covers.iter().enumerate().rev() {
            for tile in covered(cover) {
                self.starts[tile] -= 1;
                self.lists[self.starts[tile] as usize] = block as u32;
            }
        }
    }

    /// The list of the tile at a column and row of covered.
    pub(crate) fn list(&self, column: usize, row: usize) -> &[u32] {
        let tile = row * self.columns + column;
        &self.lists[self.starts[tile] as usize..self.starts[tile + 1] as usize]
    }
}
