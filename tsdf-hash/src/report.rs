//! What a frame did to a map, and the memory that a map takes.

/// What a frame did to the map.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameReport {
    /// Pixels with a depth between `min_depth` and `max_depth`.
    pub valid_pixels: usize,
    /// Those of them that lie on a surface, seen not too steeply: the ones that are fused.
    pub fused_pixels: usize,
    /// Gaps of one pixel that were filled from their neighbours and fused, as depth registered to another camera has them;
    /// not among the valid ones.
    pub filled_pixels: usize,
    /// Voxels that were updated.
    pub voxels: usize,
    /// Blocks with such voxels.
    pub blocks: usize,
    /// Blocks that were not there before.
    pub blocks_added: usize,
    /// Blocks that are no longer there.
    pub blocks_removed: usize,
    /// Blocks that were evicted from active memory by age.
    pub blocks_evicted: usize,
    /// Evicted blocks that were reloaded because the frame saw them again.
    pub blocks_reloaded: usize,
    /// Reloaded blocks that waited for longer than [`MemoryLimits::merge_timeout`](crate::storage::MemoryLimits::merge_timeout) and
    /// were merged without a decision.
    pub blocks_timed_out: usize,
}

/// Bytes and blocks of each kind of memory. A block that was evicted and seen again may have a copy in several.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MemoryUsage {
    /// Active memory, reloaded blocks included; capped by [`Settings::max_bytes`](crate::Settings::max_bytes).
    pub active_bytes: usize,
    /// Evicted blocks in RAM and the index of all evicted blocks; capped by
    /// [`MemoryLimits::host_bytes`](crate::storage::MemoryLimits::host_bytes).
    pub host_bytes: usize,
    /// Length of the swap file; capped by [`MemoryLimits::disk_bytes`](crate::storage::MemoryLimits::disk_bytes).
    pub disk_bytes: u64,
    /// Blocks in active memory, without the reloaded ones.
    pub active_blocks: usize,
    /// Blocks that were reloaded and wait for a decision.
    pub reloaded_blocks: usize,
    /// Evicted blocks in RAM, compressed or not.
    pub host_blocks: usize,
    /// Compressed blocks in the swap file.
    pub disk_blocks: usize,
    /// Compressed blocks that are still in the file that the map was opened from.
    pub file_blocks: usize,
}
