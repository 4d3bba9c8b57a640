//! An evicted block, and where it is stored.

use crate::blocks::block_history::BlockHistory;
use crate::blocks::voxel_block::VoxelBlock;
use crate::storage::summary::BlockSummary;

/// A block and where it is stored.
pub(crate) struct EvictedBlock {
    pub(crate) history: BlockHistory,
    pub(crate) location: Location,
}

pub(crate) enum Location {
    Uncompressed(Box<VoxelBlock>),
    /// Uncompressed, while a frame works on it.
    CheckedOut,
    Compressed(Box<[u8]>, BlockSummary),
    InFile(FileRange, BlockSummary),
}

/// A compressed block on disk.
#[derive(Clone, Copy)]
pub(crate) struct FileRange {
    /// Bytes from the start of the map file, or units of the swap file.
    pub(crate) at: u64,
    pub(crate) len: u16,
    pub(crate) in_swap: bool,
}

impl EvictedBlock {
    pub(crate) fn uncompressed(block: Box<VoxelBlock>, history: BlockHistory) -> Self {
        Self { history, location: Location::Uncompressed(block) }
    }

    pub(crate) fn block(&self) -> Option<&VoxelBlock> {
        if let Location::Uncompressed(block) = &self.location { Some(block) } else { None }
    }

    pub(crate) fn is_uncompressed(&self) -> bool {
        matches!(self.location, Location::Uncompressed(_) | Location::CheckedOut)
    }

    pub(crate) fn is_compressed(&self) -> bool {
        matches!(self.location, Location::Compressed(..))
    }

    pub(crate) fn summary(&self) -> Option<BlockSummary> {
        match &self.location {
            Location::Uncompressed(block) => Some(BlockSummary::of(block)),
            Location::CheckedOut => None,
            Location::Compressed(_, summary) | Location::InFile(_, summary) => Some(*summary),
        }
    }
}
