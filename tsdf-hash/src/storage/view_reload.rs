//! Evicted blocks brought back before any frame has touched them, because a camera may be looking at them.

use crate::blocks::block_key::BlockKey;
use crate::blocks::voxel_block::VoxelBlock;
use crate::error::Error;
use crate::storage::block_storage::BlockStorage;

impl BlockStorage {
    /// Brings evicted blocks into active memory, in this order, as far as there is room once what is not `in_use` has made some: how many.
    /// Where reloaded blocks wait for a decision, one that has an active copy stays evicted.
    pub(crate) fn reload_all(
        &mut self,
        keys: &[BlockKey],
        in_use: &[BlockKey],
        camera: [f64; 3],
    ) -> Result<usize, Error> {
        self.begin_call();
        for &key in in_use {
            self.active.mark_used(key, self.call);
        }
        let lacking = keys.len().saturating_sub(self.active.room());
        if lacking > 0 {
            room_if_any(self.make_room(lacking, camera))?;
        }
        let mut reloaded = 0;
        for &key in keys {
            if self.active.slot(key).is_some() {
                reloaded += usize::from(self.merges_at_once() && self.reload(key, 0.0)?);
            } else if self.active.room() > 0 {
                let mut block = Box::new(VoxelBlock::ZERO);
                if let Some(history) = self.evicted.add_to(key, &mut block)? {
                    self.evicted.remove(key);
                    self.active.insert(key, block, history);
                    reloaded += 1;
                }
            }
        }
        Ok(reloaded)
    }
}

/// What has no room elsewhere stays, and what there is room for comes back all the same.
pub(crate) fn room_if_any(made: Result<(), Error>) -> Result<(), Error> {
    match made {
        Err(Error::StorageFull { .. }) => Ok(()),
        made => made,
    }
}
