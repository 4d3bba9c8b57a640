//! What is known of a compressed block without decoding it.

use crate::blocks::voxel_block::VoxelBlock;

/// Kept beside a compressed block.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct BlockSummary {
    /// See [`VoxelBlock::fingerprint`].
    pub(crate) fingerprint: u64,
    /// See [`VoxelBlock::max_counts`].
    pub(crate) max_counts: [u16; 2],
}

impl BlockSummary {
    pub(crate) fn of(block: &VoxelBlock) -> Self {
        Self { fingerprint: block.fingerprint(), max_counts: block.max_counts() }
    }
}
