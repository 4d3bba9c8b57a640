//! Blocks that were evicted and have been seen again: kept apart from the active ones until a decision about them (thesis
//! Paper I, sections 4.3 and 4.5).

use nalgebra::Point3;

use crate::blocks::active_blocks::ActiveBlocks;
use crate::blocks::block_history::BlockHistory;
use crate::blocks::block_key::BlockKey;
use crate::blocks::block_table::BlockTable;
use crate::blocks::trilinear::TrilinearCell;
use crate::blocks::voxel_block::VoxelBlock;
use crate::settings::Settings;

/// A reloaded block that waits to be merged.
pub(crate) struct ReloadedBlock {
    pub(crate) block: Box<VoxelBlock>,
    pub(crate) history: BlockHistory,
    /// When it was reloaded.
    pub(crate) time: f64,
}

/// The reloaded blocks that wait to be merged: the old surface, apart from the new one.
pub struct ReloadedBlocks<'a> {
    blocks: &'a BlockTable<ReloadedBlock>,
    active: &'a ActiveBlocks,
    settings: &'a Settings,
}

/// A reloaded block in a certain state: evicted and reloaded again, or with more added to it, it is another.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct ReloadedVersion {
    pub(crate) key: BlockKey,
    /// Bits of the time when it was reloaded.
    time: u64,
    /// Frames in it.
    frames: u32,
}

impl<'a> ReloadedBlocks<'a> {
    pub(crate) fn new(blocks: &'a BlockTable<ReloadedBlock>, active: &'a ActiveBlocks, settings: &'a Settings) -> Self {
        Self { blocks, active, settings }
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.blocks.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// When the first of them was reloaded, seconds; `None` if there is none.
    pub fn reloaded_at(&self) -> Option<f64> {
        self.blocks.values().iter().map(|reloaded| reloaded.time).reduce(f64::min)
    }

    /// Block coordinates, ascending; the block `b` spans `8h b .. 8h (b + 1)`.
    pub fn blocks(&self) -> Vec<[i32; 3]> {
        let mut keys = self.blocks.keys().to_vec();
        keys.sort_unstable();
        keys.into_iter().map(BlockKey::block).collect()
    }

    /// Signed distance from the old surface, metres, as [`Map::distance`](crate::Map::distance).
    pub fn distance(&self, point_in_world: &Point3<f64>) -> Option<f64> {
        TrilinearCell::around(self.settings, |key| self.block(key), point_in_world).map(|cell| cell.distance())
    }

    /// Signed distance from the new surface, that of the active blocks which they would be merged into, metres.
    pub fn active_distance(&self, point_in_world: &Point3<f64>) -> Option<f64> {
        TrilinearCell::around(self.settings, |key| self.active.get(key), point_in_world).map(|cell| cell.distance())
    }

    /// The settings of the map.
    pub fn settings(&self) -> &Settings {
        self.settings
    }

    /// The blocks in the state they are in, ascending.
    pub(crate) fn versions(&self) -> Vec<ReloadedVersion> {
        let blocks = self.blocks.keys().iter().zip(self.blocks.values());
        let version = |(&key, reloaded): (&BlockKey, &ReloadedBlock)| ReloadedVersion {
            key,
            time: reloaded.time.to_bits(),
            frames: reloaded.history.frames,
        };
        let mut all: Vec<_> = blocks.map(version).collect();
        all.sort_unstable();
        all
    }

    /// The old copy of a block, for ray casting.
    pub(crate) fn block(&self, key: BlockKey) -> Option<&VoxelBlock> {
        self.blocks.get(key).map(|reloaded| &*reloaded.block)
    }
}
