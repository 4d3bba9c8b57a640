//! All copies of all blocks, and their moves (thesis Paper I, section 4.3, steps (a), (c), (d)).
//!
//! Sums add up, so a block may have several copies at once: one that was evicted, and another one begun afresh when the
//! surface was seen again. The map is the sum of the copies, whenever and wherever they are brought together; no move
//! changes a sum. What all copies of a block sum up to always fits its counters: that is seen to when a frame is fused.

use crate::blocks::active_blocks::ActiveBlocks;
use crate::blocks::block_history::BlockHistory;
use crate::blocks::block_key::BlockKey;
use crate::blocks::block_table::BlockTable;
use crate::blocks::voxel_block::{MAX_COLOURS, VoxelBlock};
use crate::error::Error;
use crate::file::writer::{Blocks, Visit};
use crate::hashing::mix64;
use crate::settings::MemoryLimits;
use crate::storage::block_file::{BlockFile, StoredBlock};
use crate::storage::evicted_blocks::EvictedBlocks;
use crate::storage::reloaded::ReloadedBlock;
use crate::storage::swap_file::SwapFile;
use crate::storage::victims;

/// How many blocks a frame has moved.
#[derive(Clone, Copy, Default)]
pub(crate) struct Transfers {
    pub(crate) evicted: usize,
    pub(crate) reloaded: usize,
    /// Reloaded blocks that were merged without a decision.
    pub(crate) timed_out: usize,
}

/// All copies of all blocks.
pub(crate) struct BlockStorage {
    pub(crate) active: ActiveBlocks,
    pub(crate) reloaded: BlockTable<ReloadedBlock>,
    pub(crate) evicted: EvictedBlocks,
    limits: MemoryLimits,
    /// Number of the current or last call.
    pub(crate) call: u32,
}

impl BlockStorage {
    pub(crate) fn new(max_bytes: usize, limits: MemoryLimits, swap: Option<SwapFile>) -> Result<Self, Error> {
        let (active, reloaded) = (ActiveBlocks::new(max_bytes)?, BlockTable::new());
        Ok(Self { active, reloaded, evicted: EvictedBlocks::new(limits.host_bytes, swap), limits, call: 0 })
    }

    /// Begins a call: what it does not touch can be evicted to make room.
    pub(crate) fn begin_call(&mut self) {
        self.call = self.call.wrapping_add(1);
    }

    /// Takes in the blocks of a file: as evicted ones, or at once where blocks cannot be evicted.
    pub(crate) fn open(&mut self, file: BlockFile, blocks: &[StoredBlock]) -> Result<(), Error> {
        if self.evicted.is_enabled() {
            return self.evicted.open(file, blocks);
        }
        let file = EvictedBlocks::of_file(file, blocks);
        for stored in blocks {
            if self.active.room() == 0 {
                return Err(self.active.out_of_budget());
            }
            let mut block = Box::new(VoxelBlock::ZERO);
            let history = file.add_to(stored.key, &mut block)?.unwrap_or_default();
            self.active.insert(stored.key, block, history);
        }
        Ok(())
    }

    /// Bytes of active memory, reloaded blocks included.
    pub(crate) fn active_bytes(&self) -> usize {
        self.active.bytes() + self.reloaded_bytes(0)
    }

    /// Bytes of the reloaded blocks when there are `added` more, at the worst moment.
    fn reloaded_bytes(&self, added: usize) -> usize {
        let count = self.reloaded.len() + added;
        if count == 0 { 0 } else { self.reloaded.bytes_with(added) + count * size_of::<VoxelBlock>() }
    }

    /// Whether every block has one copy, in active memory.
    pub(crate) fn all_active(&self) -> bool {
        self.evicted.is_empty() && self.reloaded.len() == 0
    }

    /// The keys of the map, ascending.
    pub(crate) fn sorted_keys(&self) -> Vec<BlockKey> {
        let mut keys = self.active.sorted_keys();
        if !self.all_active() {
            keys.extend(self.reloaded.keys());
            keys.extend(self.evicted.keys());
            keys.sort_unstable();
            keys.dedup();
        }
        keys
    }

    /// Number of blocks.
    pub(crate) fn len(&self) -> usize {
        if self.all_active() { self.active.len() } else { self.sorted_keys().len() }
    }

    /// Whether there is any copy of a block.
    pub(crate) fn contains(&self, key: BlockKey) -> bool {
        self.active.slot(key).is_some() || self.reloaded.get(key).is_some() || self.evicted.contains(key)
    }

    /// The blocks, once each, whose sum has changed since the change clock stood at `stamp`, all of them for `None`; some that have
    /// only been moved may be among them.
    pub(crate) fn changed_since(&self, stamp: Option<u64>) -> Vec<BlockKey> {
        let Some(stamp) = stamp else { return self.sorted_keys() };
        let later = |&(_, history): &(BlockKey, BlockHistory)| history.stamp > stamp;
        let mut changed: Vec<BlockKey> = self.active.histories().filter(later).map(|(key, _)| key).collect();
        if self.evicted.latest_stamp() > stamp {
            changed.extend(self.evicted.histories().filter(later).map(|(key, _)| key));
            changed.sort_unstable();
            changed.dedup();
        }
        changed
    }

    /// A block: its only copy if that needs no decoding, else the sum of all, which is added up in `sum`.
    pub(crate) fn sum<'a>(&'a self, key: BlockKey, sum: &'a mut VoxelBlock) -> Result<Option<&'a VoxelBlock>, Error> {
        let (active, reloaded) = (self.active.get(key), self.reloaded.get(key));
        if self.all_active() || (reloaded.is_none() && !self.evicted.contains(key)) {
            return Ok(active);
        }
        if active.is_none()
            && reloaded.is_none()
            && let Some(uncompressed) = self.evicted.uncompressed(key)
        {
            return Ok(Some(uncompressed));
        }
        self.total(key, sum)?;
        Ok(Some(sum))
    }

    /// The sum of all copies of a block, and what is known of it.
    pub(crate) fn total(&self, key: BlockKey, sum: &mut VoxelBlock) -> Result<BlockHistory, Error> {
        *sum = VoxelBlock::ZERO;
        let mut history = self.evicted.add_to(key, sum)?.unwrap_or_default();
        if let Some(reloaded) = self.reloaded.get(key) {
            sum.add(&reloaded.block);
            history = history.merged(reloaded.history);
        }
        if let Some((block, newer)) = self.active.get(key).zip(self.active.history(key)) {
            sum.add(block);
            history = history.merged(newer);
        }
        Ok(history)
    }

    /// The fingerprints of the sums of all copies, in the order of the keys.
    pub(crate) fn fingerprints(&self) -> impl Iterator<Item = (BlockKey, u64)> {
        self.sorted_keys().into_iter().map(|key| {
            let copies = [
                self.active.get(key).map(VoxelBlock::fingerprint),
                self.reloaded.get(key).map(|reloaded| reloaded.block.fingerprint()),
                self.evicted.summary(key).map(|summary| summary.fingerprint),
            ];
            (key, copies.into_iter().flatten().fold(0, u64::wrapping_add))
        })
    }

    /// A hash of the sums of all copies.
    pub(crate) fn hash(&self) -> u64 {
        hash_blocks(self.fingerprints())
    }

    /// Whether a block can be added to the other copies without running over.
    pub(crate) fn fits(&self, key: BlockKey, block: &VoxelBlock) -> Result<bool, Error> {
        let evicted = self.evicted.summary(key).map(|summary| summary.max_counts);
        let reloaded = self.reloaded.get(key).map(|reloaded| reloaded.block.max_counts());
        if evicted.is_none() && reloaded.is_none() {
            return Ok(true);
        }
        let counts = [Some(block.max_counts()), evicted, reloaded];
        let sum = |k: usize| counts.iter().flatten().map(|counts| u32::from(counts[k])).sum::<u32>();
        if u16::try_from(sum(0)).is_ok() && sum(1) <= u32::from(MAX_COLOURS) {
            return Ok(true);
        }
        // The largest of each need not meet in one voxel.
        let mut all = Box::new(VoxelBlock::ZERO);
        self.evicted.add_to(key, &mut all)?;
        let overflow = self.reloaded.get(key).is_some_and(|reloaded| all.add(&reloaded.block));
        Ok(!(all.add(block) || overflow))
    }

    /// Takes in a block that another memory has held and that has no copy here, where there is room. After an error nothing has
    /// changed.
    #[cfg(feature = "gpu")]
    pub(crate) fn add_block(&mut self, key: BlockKey, block: &VoxelBlock, history: BlockHistory) -> Result<(), Error> {
        if self.active.room() == 0 {
            self.make_room(1, [0.0; 3])?;
        }
        if self.active.room() > 0 {
            self.active.insert(key, Box::new(block.clone()), history);
            return Ok(());
        }
        let put = self.evicted.put(key, Box::new(block.clone()), history);
        put.map_err(|(_, error)| self.storage_error(error))
    }

    /// Removes all copies of a block; no change of the map, because another memory holds it.
    #[cfg(feature = "gpu")]
    pub(crate) fn forget(&mut self, key: BlockKey) {
        self.active.remove(key);
        self.evicted.remove(key);
        self.reloaded.remove(key);
    }

    /// Of a block that begins with a frame of the current call.
    pub(crate) fn new_history(&mut self, time: f64) -> BlockHistory {
        let stamp = self.active.clock.tick();
        BlockHistory { last_update: time, frames: 1, call: self.call, stamp }
    }

    /// Where blocks cannot be evicted it is active memory that is full.
    pub(crate) fn storage_error(&self, error: Error) -> Error {
        if self.evicted.is_enabled() { error } else { self.active.out_of_budget() }
    }

    /// Moves after a frame: what it saw again is reloaded, what has not been updated for long is evicted. A move that finds
    /// no room, or a disk that fails, is left for later: the blocks stay where they are.
    pub(crate) fn transfer(&mut self, touched: &[BlockKey], time: f64) -> Transfers {
        let late = self.reloaded.values().iter().any(|block| time - block.time >= self.limits.merge_timeout);
        let timed_out = if late { self.merge_reloaded().unwrap_or_default() } else { 0 };
        Transfers { timed_out, reloaded: self.reload_touched(touched, time), evicted: self.evict_aged(time) }
    }

    /// Step (a): what has not been updated for long is evicted, the oldest first.
    fn evict_aged(&mut self, time: f64) -> usize {
        if !self.evicted.is_enabled() {
            return 0;
        }
        let old = victims::aged(self.active.histories(), time, &self.limits);
        old.into_iter().take_while(|&key| self.evict(key).is_ok()).count()
    }

    /// Steps (c) and (d): evicted copies of what the frame touched are reloaded.
    fn reload_touched(&mut self, touched: &[BlockKey], time: f64) -> usize {
        if self.evicted.is_empty() {
            return 0;
        }
        let mut reloaded = 0;
        for &key in touched {
            if reloaded == self.limits.max_transfers {
                break;
            }
            if self.evicted.contains(key) && self.reload(key, time).unwrap_or(false) {
                reloaded += 1;
            }
        }
        reloaded
    }

    /// Whether reloaded blocks wait for no decision.
    pub(crate) fn merges_at_once(&self) -> bool {
        self.limits.merge_timeout == 0.0
    }

    /// Brings an evicted copy into active memory, or to the reloaded blocks; `false` if there is no room for it there.
    pub(crate) fn reload(&mut self, key: BlockKey, time: f64) -> Result<bool, Error> {
        let (block, history) = if self.merges_at_once() {
            let Some(copy) = self.active.get_mut(key) else { return Ok(false) };
            copy
        } else {
            if self.reloaded.get(key).is_none() {
                if self.active.room() < 2 {
                    return Ok(false);
                }
                let block = Box::new(VoxelBlock::ZERO);
                self.reloaded.insert(key, ReloadedBlock { block, history: BlockHistory::default(), time });
                self.active.set_aside = self.reloaded_bytes(1);
            }
            let Some(reloaded) = self.reloaded.get_mut(key) else { return Ok(false) };
            (&mut *reloaded.block, &mut reloaded.history)
        };
        if let Some(older) = self.evicted.add_to(key, block)? {
            *history = older.merged(*history);
            self.evicted.remove(key);
        }
        Ok(true)
    }

    /// Merges all reloaded blocks: returns how many there were.
    pub(crate) fn merge_reloaded(&mut self) -> Result<usize, Error> {
        let mut keys = self.reloaded.keys().to_vec();
        keys.sort_unstable();
        let count = keys.len();
        for key in keys {
            self.merge_reloaded_block(key)?;
        }
        Ok(count)
    }

    /// Merges a reloaded block into its active copy, or makes it the active copy, or evicts it if there is no room.
    pub(crate) fn merge_reloaded_block(&mut self, key: BlockKey) -> Result<(), Error> {
        let Some(reloaded) = self.reloaded.remove(key) else { return Ok(()) };
        self.active.set_aside = self.reloaded_bytes(1);
        if let Some((block, history)) = self.active.get_mut(key) {
            block.add(&reloaded.block);
            *history = reloaded.history.merged(*history);
        } else if self.active.room() > 0 {
            self.active.insert(key, reloaded.block, reloaded.history);
        } else {
            return self.evict_reloaded(key, reloaded);
        }
        Ok(())
    }

    fn evict_reloaded(&mut self, key: BlockKey, reloaded: ReloadedBlock) -> Result<(), Error> {
        let ReloadedBlock { block, history, time } = reloaded;
        let put = self.evicted.put(key, block, history).map_err(|(block, error)| {
            self.reloaded.insert(key, ReloadedBlock { block, history, time });
            error
        });
        self.active.set_aside = self.reloaded_bytes(1);
        put
    }

    /// Evicts up to `count` blocks that the current call has not touched, by age, then by distance from the camera (in
    /// blocks); then reloaded ones.
    pub(crate) fn make_room(&mut self, count: usize, camera: [f64; 3]) -> Result<(), Error> {
        if !self.evicted.is_enabled() {
            return Ok(());
        }
        let victims = victims::untouched(self.active.histories(), self.call, count, camera);
        for &key in &victims {
            self.evict(key)?;
        }
        let mut reloaded = self.reloaded.keys().to_vec();
        reloaded.sort_unstable();
        for key in reloaded.into_iter().take(count - victims.len()) {
            if let Some(block) = self.reloaded.remove(key) {
                self.evict_reloaded(key, block)?;
            }
        }
        Ok(())
    }

    /// Evicts an active block, into its evicted copy if it has one.
    fn evict(&mut self, key: BlockKey) -> Result<(), Error> {
        let Some((block, history)) = self.active.remove(key) else { return Ok(()) };
        self.evicted.put(key, block, history).map_err(|(block, error)| {
            self.active.insert(key, block, history);
            error
        })
    }

    /// How many blocks [`make_room`](Self::make_room) can evict at most.
    pub(crate) fn evictable(&self) -> usize {
        if !self.evicted.is_enabled() {
            return 0;
        }
        self.active.histories().filter(|(_, history)| history.call != self.call).count() + self.reloaded.len()
    }
}

impl Blocks for BlockStorage {
    fn visit(&self, visit: &mut Visit) -> Result<(), Error> {
        let mut sum = Box::new(VoxelBlock::ZERO);
        for key in self.sorted_keys() {
            let history = self.total(key, &mut sum)?;
            visit(key, &sum, history)?;
        }
        Ok(())
    }
}

/// The hash of a map from the fingerprints of its blocks, in the order of their keys.
pub(crate) fn hash_blocks(fingerprints: impl Iterator<Item = (BlockKey, u64)>) -> u64 {
    fingerprints.fold(0, |hash, (key, fingerprint)| mix64(mix64(hash ^ key.0).wrapping_add(fingerprint)))
}
