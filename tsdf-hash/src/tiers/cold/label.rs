//! What is known of a packed block without unpacking it.

use crate::block::Block;
use crate::store::Seen;

/// Kept beside a packed block.
#[derive(Clone, Copy, Default)]
pub(crate) struct Label {
    pub(crate) print: u64,
    /// Time of the last frame that updated it, seconds, and the number of frames that did.
    pub(crate) last: f64,
    pub(crate) frames: u32,
    pub(crate) peaks: [u16; 2],
    /// See [`Seen::stamp`].
    pub(crate) stamp: u64,
}

impl Label {
    pub(crate) fn of(block: &Block, seen: Seen) -> Self {
        Self { print: block.print(), last: seen.last, frames: seen.frames, peaks: block.peaks(), stamp: seen.stamp }
    }

    /// Whether these can be labels of the same block.
    pub(super) fn same_block(self, other: Self) -> bool {
        self.print == other.print && self.peaks == other.peaks
    }

    /// As a copy that no call has touched.
    pub(crate) fn seen(self) -> Seen {
        Seen { last: self.last, frames: self.frames, call: 0, stamp: self.stamp }
    }
}
