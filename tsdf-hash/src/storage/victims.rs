//! Which blocks leave a memory first.

use crate::blocks::block_history::BlockHistory;
use crate::blocks::block_key::BlockKey;
use crate::blocks::total_order::TotalOrder;
use crate::settings::MemoryLimits;

/// Blocks that have not been updated for long, the oldest first, as many as may be moved (thesis Paper I, section 4.3, step (a)).
pub(crate) fn aged(
    blocks: impl Iterator<Item = (BlockKey, BlockHistory)>,
    time: f64,
    limits: &MemoryLimits,
) -> Vec<BlockKey> {
    let old = blocks
        .filter(|(_, history)| time - history.last_update > limits.max_age)
        .map(|(key, history)| (TotalOrder(history.last_update), key))
        .collect();
    first(limits.max_transfers, old).into_iter().map(|(_, key)| key).collect()
}

/// Up to `count` blocks that the current call has not touched, by age, then by distance from the camera (in blocks).
pub(crate) fn untouched(
    blocks: impl Iterator<Item = (BlockKey, BlockHistory)>,
    call: u32,
    count: usize,
    camera: [f64; 3],
) -> Vec<BlockKey> {
    let untouched = blocks
        .filter(|(_, history)| history.call != call)
        .map(|(key, history)| (TotalOrder(history.last_update), TotalOrder(-distance(key, camera)), key))
        .collect();
    first(count, untouched).into_iter().map(|(_, _, key)| key).collect()
}

/// The least `count`, ascending.
fn first<T: Ord>(count: usize, mut all: Vec<T>) -> Vec<T> {
    if all.len() > count {
        all.select_nth_unstable(count);
        all.truncate(count);
    }
    all.sort_unstable();
    all
}

/// Squared distance of a block from the camera, in blocks.
fn distance(key: BlockKey, camera: [f64; 3]) -> f64 {
    key.block().iter().zip(camera).map(|(&c, e)| (f64::from(c) + 0.5 - e).powi(2)).sum()
}
