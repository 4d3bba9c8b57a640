//! The blocks that a view can see a surface in, unpacked.

use crate::blocks::active_blocks::ActiveBlocks;
use crate::blocks::block_key::BlockKey;
use crate::blocks::voxel_block::{ONE, SIDE, VoxelBlock};
use crate::parallel::in_chunks;
use crate::ray_cast::camera::Camera;
use crate::ray_cast::settings::RayCastSettings;

/// Nodes along the edge of a block: its own voxels and the first ones of the next block.
pub(crate) const NODES: usize = SIDE + 1;
/// Nodes of a block.
pub(crate) const ALL: usize = NODES * NODES * NODES;

/// One block with its upper border, node `(x, y, z)` at entry `x + 9 (y + 9 z)`, so that every cell of it is whole.
#[derive(Clone, Debug)]
pub(crate) struct UnpackedBlock {
    /// Mean normalised distance; NaN where nothing was observed.
    pub(crate) distance: [f32; ALL],
    pub(crate) weight: [u16; ALL],
    /// Four lanes of 16 bits: R, G, B in `0..=255`, and one; all zero where no colour was observed.
    pub(crate) colour: [u64; ALL],
}

/// A block in a view.
#[derive(Clone, Copy, Debug)]
pub(crate) struct VisibleBlock {
    /// Which block.
    pub(crate) block: usize,
    /// From the first node to the camera, voxels.
    pub(crate) origin: [f32; 3],
    /// The box around the cells that the surface crosses, relative to the camera, voxels.
    pub(crate) low: [f32; 3],
    pub(crate) high: [f32; 3],
}

/// The range of the cells that the surface crosses, `[first, last + 1]`.
pub(crate) type CellRange = [[u8; 3]; 2];

impl VisibleBlock {
    pub(crate) fn new(block: usize, key: BlockKey, range: CellRange, camera: &Camera) -> Self {
        let offset = camera.offset(key.block());
        let [low, high] = range.map(|cell| [0, 1, 2].map(|k| offset[k] + f32::from(cell[k])));
        Self { block, origin: offset.map(|c| -c), low, high }
    }
}

/// The blocks with a surface.
#[derive(Clone, Debug, Default)]
pub(crate) struct UnpackedBlocks {
    pub(crate) blocks: Vec<UnpackedBlock>,
    /// In an order in which no ray meets a later one first.
    pub(crate) visible: Vec<VisibleBlock>,
}

impl UnpackedBlocks {
    pub(crate) fn select(&mut self, active: &ActiveBlocks, camera: &Camera, settings: &RayCastSettings) {
        let seen = in_view(active.keys().iter().copied(), camera);
        if self.blocks.len() < seen.len() {
            self.blocks.resize(seen.len(), UnpackedBlock::UNSEEN);
        }
        let mut work: Vec<_> = self.blocks.iter_mut().zip(seen).collect();
        // Each part fills its own blocks from the first one on, as far as there are blocks with a surface.
        let parts = in_chunks(&mut work, settings.threads, |part| {
            let (mut filled, mut ranges) = (0, Vec::new());
            for k in 0..part.len() {
                let key = part[k].1;
                if let Some(range) = part[filled].0.read(active, key, settings.colour) {
                    ranges.push((key, range));
                    filled += 1;
                }
            }
            (part.len(), ranges)
        });
        self.visible.clear();
        let mut first = 0;
        for (length, ranges) in parts {
            for (k, (key, range)) in ranges.into_iter().enumerate() {
                self.visible.push(VisibleBlock::new(first + k, key, range, camera));
            }
            first += length;
        }
    }
}

/// The blocks in view, front to back.
pub(crate) fn in_view(keys: impl Iterator<Item = BlockKey>, camera: &Camera) -> Vec<BlockKey> {
    let radius = 0.5 * 3.0_f64.sqrt() * SIDE as f64;
    let mut seen: Vec<(u32, BlockKey)> = Vec::new();
    for key in keys {
        let block = key.block();
        if camera.sees(camera.offset(block).map(|c| c + 0.5 * SIDE as f32), radius) {
            // A ray goes from block to block through a face, always away from the camera: with each step the number of
            // blocks to the camera's own grows by one.
            let steps = (0..3).map(|k| block[k].abs_diff(camera.base[k])).sum();
            seen.push((steps, key));
        }
    }
    seen.sort_unstable();
    seen.into_iter().map(|(_, key)| key).collect()
}

impl UnpackedBlock {
    const UNSEEN: Self = Self { distance: [f32::NAN; ALL], weight: [0; ALL], colour: [0; ALL] };

    /// Unpacks a block; `None` if the surface does not cross it.
    fn read(&mut self, active: &ActiveBlocks, key: BlockKey, with_colour: bool) -> Option<CellRange> {
        let blocks = [0, 1, 2, 3, 4, 5, 6, 7].map(|n| active.get(key.neighbour([n & 1, n >> 1 & 1, n >> 2])?));
        for (n, block) in blocks.iter().enumerate() {
            each_row(n, |from, to, length| self.read_row(*block, from, to, length));
        }
        let range = self.crossed()?;
        if with_colour {
            for (n, block) in blocks.iter().enumerate() {
                each_row(n, |from, to, length| self.read_colours(*block, from, to, length));
            }
        }
        Some(range)
    }

    fn read_row(&mut self, block: Option<&VoxelBlock>, from: usize, to: usize, length: usize) {
        let (distance, weight) = (&mut self.distance[to..to + length], &mut self.weight[to..to + length]);
        let Some(block) = block else {
            distance.fill(f32::NAN);
            weight.fill(0);
            return;
        };
        let (sums, weights) = (&block.distance[from..from + length], &block.weight[from..from + length]);
        for k in 0..length {
            // 0 / 0 where nothing was observed.
            distance[k] = sums[k] as f32 / (f32::from(weights[k]) * ONE as f32);
            weight[k] = weights[k];
        }
    }

    fn read_colours(&mut self, block: Option<&VoxelBlock>, from: usize, to: usize, length: usize) {
        for k in 0..length {
            let rgb = block.and_then(|block| block.mean_colour(from + k));
            self.colour[to + k] = rgb.map_or(0, |rgb| {
                let [r, g, b] = rgb.map(|c| (c + 0.5) as u64);
                r | g << 16 | b << 32 | 1 << 48
            });
        }
    }

    /// The range of the cells that have observed nodes on both sides.
    fn crossed(&self) -> Option<CellRange> {
        let (mut solid, mut free) = ([0_u16; NODES * NODES], [0_u16; NODES * NODES]);
        for (row, (solid, free)) in solid.iter_mut().zip(&mut free).enumerate() {
            for (x, value) in self.distance[NODES * row..NODES * (row + 1)].iter().enumerate() {
                *solid |= u16::from(*value < 0.0) << x;
                *free |= u16::from(*value >= 0.0) << x;
            }
        }
        let (mut low, mut high, mut columns) = ([u8::MAX; 3], [0_u8; 3], 0_u16);
        for z in 0..SIDE {
            for y in 0..SIDE {
                let row = y + NODES * z;
                let any = |rows: &[u16]| rows[row] | rows[row + 1] | rows[row + NODES] | rows[row + NODES + 1];
                let (solid, free) = (any(&solid), any(&free));
                let cells = (solid | solid >> 1) & (free | free >> 1) & 0xff;
                if cells != 0 {
                    columns |= cells;
                    (low[1], high[1]) = (low[1].min(y as u8), high[1].max(y as u8 + 1));
                    (low[2], high[2]) = (low[2].min(z as u8), high[2].max(z as u8 + 1));
                }
            }
        }
        low[0] = columns.trailing_zeros() as u8;
        high[0] = (16 - columns.leading_zeros()) as u8;
        (columns != 0).then_some([low, high])
    }
}

/// The rows that a block takes from the block at `+1` along x (bit 0 of `n`), y (bit 1) and z (bit 2): first voxel,
/// first node, length.
#[inline(always)]
fn each_row(n: usize, mut copy: impl FnMut(usize, usize, usize)) {
    let range = |axis: usize| if n >> axis & 1 == 1 { SIDE..NODES } else { 0..SIDE };
    for z in range(2) {
        for y in range(1) {
            let x = range(0);
            copy(x.start % SIDE + SIDE * (y % SIDE + SIDE * (z % SIDE)), x.start + NODES * (y + NODES * z), x.len());
        }
    }
}
