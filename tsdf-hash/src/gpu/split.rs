//! Which blocks of a frame are where on the device.

use crate::blocks::block_history::BlockHistory;
use crate::blocks::block_key::BlockKey;
use crate::gpu::fuse::{Mode, Pass, UpdateCount, fresh};
use crate::gpu::pool::Pool;
use crate::integration::integrator::Operation;

/// The mode of an update.
pub(super) fn mode(operation: Operation) -> Mode {
    if operation == Operation::Integrate { Mode::Integrate } else { Mode::Deintegrate }
}

/// The blocks that a frame has touched, or would.
pub(super) fn touched<'a>(
    blocks: impl Iterator<Item = &'a (BlockKey, u32)>,
    counts: &[UpdateCount],
) -> Vec<(BlockKey, UpdateCount)> {
    blocks.zip(counts).map(|((key, _), count)| (*key, *count)).filter(|(_, count)| count.voxels() > 0).collect()
}

/// Blocks of a frame, with their slots.
pub(super) struct Split {
    pub(super) absent: Vec<(BlockKey, u32)>,
    /// By page.
    pub(super) present: Vec<Vec<(BlockKey, u32)>>,
}

impl Split {
    pub(super) fn new(pool: &Pool, keys: &[BlockKey]) -> Self {
        let mut split = Self { absent: Vec::new(), present: vec![Vec::new(); pool.pages.len()] };
        for &key in keys {
            match pool.get(key) {
                Some(place) => split.present[place.page].push((key, place.slot)),
                None => split.absent.push((key, fresh(0))),
            }
        }
        split
    }

    /// Blocks that get slots now, with this history.
    pub(super) fn added(pool: &mut Pool, keys: &[BlockKey], history: BlockHistory) -> Self {
        let mut split = Self { absent: Vec::new(), present: vec![Vec::new(); pool.pages.len()] };
        for &key in keys {
            let place = pool.insert(key, history);
            split.present[place.page].push((key, fresh(place.slot)));
        }
        split
    }

    pub(super) fn count(&self) -> Pass<'_> {
        Pass { mode: Mode::Count, page: 0, blocks: &self.absent }
    }

    pub(super) fn update(&self, mode: Mode) -> impl Iterator<Item = Pass<'_>> {
        self.present.iter().enumerate().map(move |(page, blocks)| Pass { mode, page, blocks })
    }
}
