//! Whether what is seen again may be fused with the new frames (thesis Paper I, section 4.5).

use crate::storage::reloaded::ReloadedBlocks;

/// What to do with reloaded blocks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MergeDecision {
    /// The new frames agree with them, or have been corrected: add them to the active map.
    Merge,
    /// Keep them apart for now; [`MemoryLimits::merge_timeout`](crate::storage::MemoryLimits::merge_timeout) limits how long.
    Defer,
}

/// Decides about reloaded blocks. A closure will do.
pub trait MergePolicy {
    /// Looks at the reloaded blocks. Compare [`ReloadedBlocks::distance`] with [`ReloadedBlocks::active_distance`] on the same
    /// surface, or align the two, to find how far the pose has drifted since.
    fn decide(&mut self, reloaded: &ReloadedBlocks) -> MergeDecision;
}

impl<F: FnMut(&ReloadedBlocks) -> MergeDecision> MergePolicy for F {
    fn decide(&mut self, reloaded: &ReloadedBlocks) -> MergeDecision {
        self(reloaded)
    }
}

/// For poses without drift: reloaded blocks are merged.
#[derive(Clone, Copy, Debug, Default)]
pub struct MergeImmediately;

impl MergePolicy for MergeImmediately {
    fn decide(&mut self, _: &ReloadedBlocks) -> MergeDecision {
        MergeDecision::Merge
    }
}
