//! When a block was updated and how often: what eviction goes by.

/// No part of the exact state: equal maps may differ in it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct BlockHistory {
    /// Time of the last frame that updated the block, seconds.
    pub(crate) last_update: f64,
    /// Frames that updated it.
    pub(crate) frames: u32,
    /// Number of the last call that touched it.
    pub(crate) call: u32,
    /// When it last changed, on the map's [`ChangeClock`](crate::changes::ChangeClock). It goes with the block when that
    /// is evicted; a move may raise it without a change.
    pub(crate) stamp: u64,
}

impl BlockHistory {
    /// Of the sum of two copies of a block.
    pub(crate) fn merged(self, other: Self) -> Self {
        let newer = if other.last_update > self.last_update { other } else { self };
        Self {
            frames: self.frames.saturating_add(other.frames),
            call: self.call.max(other.call),
            stamp: self.stamp.max(other.stamp),
            ..newer
        }
    }

    /// Notes that a frame taken at `time` was fused.
    pub(crate) fn integrated(&mut self, time: f64) {
        self.last_update = time;
        self.frames = self.frames.saturating_add(1);
    }

    /// Notes that a frame was taken out.
    pub(crate) fn deintegrated(&mut self) {
        self.frames = self.frames.saturating_sub(1);
    }
}

#[cfg(test)]
mod tests {
    use super::BlockHistory;

    #[test]
    fn two_copies_have_the_frames_of_both_and_the_latest_of_all_else() {
        let one = BlockHistory { last_update: 3.0, frames: 5, call: 2, stamp: 40 };
        let other = BlockHistory { last_update: 2.0, frames: 7, call: 9, stamp: 30 };
        let merged = BlockHistory { last_update: 3.0, frames: 12, call: 9, stamp: 40 };
        assert_eq!([one.merged(other), other.merged(one)], [merged; 2]);
    }
}
