//! The blocks in active memory, and the bytes they take.

use crate::blocks::block_history::BlockHistory;
use crate::blocks::block_key::BlockKey;
use crate::blocks::block_table::BlockTable;
use crate::blocks::voxel_block::VoxelBlock;
use crate::changes::ChangeClock;
use crate::error::Error;

/// The mesh numbers vertices with 32 bits, 1536 at most in a block.
pub(crate) const MAX_BLOCKS: usize = 1 << 21;

struct Slot {
    block: Option<Box<VoxelBlock>>,
    history: BlockHistory,
}

/// Blocks in dense slots, found through a hash table. A block is `None` only while a frame works on it.
pub(crate) struct ActiveBlocks {
    slots: BlockTable<Slot>,
    pub(crate) clock: ChangeClock,
    max_bytes: usize,
    /// Blocks of the budget that are kept free, for work.
    spare: usize,
    /// Bytes of the budget that others use.
    pub(crate) set_aside: usize,
}

impl ActiveBlocks {
    pub(crate) fn new(max_bytes: usize) -> Result<Self, Error> {
        let most = max_bytes / size_of::<VoxelBlock>();
        let spare = (most / 16).clamp(3, 256);
        let blocks = Self { slots: BlockTable::new(), clock: ChangeClock::new(), max_bytes, spare, set_aside: 0 };
        if blocks.room() == 0 {
            let requirement = "large enough for one block and three to work with: 65536 bytes do";
            return Err(Error::InvalidSetting { name: "max_bytes", value: max_bytes as f64, requirement });
        }
        Ok(blocks)
    }

    /// Changes the cap, whatever is here, and gives back the memory of blocks that have gone.
    #[cfg(feature = "gpu")]
    pub(crate) fn resize(&mut self, max_bytes: usize) -> Result<(), Error> {
        let mut resized = Self::new(max_bytes)?;
        std::mem::swap(&mut resized.clock, &mut self.clock);
        resized.set_aside = self.set_aside;
        for key in self.keys().to_vec() {
            if let Some(slot) = self.slots.remove(key) {
                resized.slots.insert(key, slot);
            }
        }
        *self = resized;
        Ok(())
    }

    pub(crate) fn len(&self) -> usize {
        self.slots.len()
    }

    pub(crate) fn bytes(&self) -> usize {
        self.slots.bytes() + self.len() * size_of::<VoxelBlock>()
    }

    /// Blocks that may be in work outside the slots, three at least.
    pub(crate) fn spare(&self) -> usize {
        self.spare
    }

    /// The most blocks that can be added under the cap.
    pub(crate) fn room(&self) -> usize {
        let fits = |added: usize| {
            let blocks = self.len() + added + self.spare;
            self.slots.bytes_with(added) + blocks * size_of::<VoxelBlock>() + self.set_aside <= self.max_bytes
        };
        // Growth of the table makes the need jump, so the bound is searched for: it is monotone in the number of blocks.
        let most = MAX_BLOCKS.saturating_sub(self.len()).min(self.max_bytes / size_of::<VoxelBlock>());
        let (mut good, mut bad) = (0, most + 1);
        while good + 1 < bad {
            let middle = usize::midpoint(good, bad);
            if fits(middle) { good = middle } else { bad = middle }
        }
        good
    }

    pub(crate) fn out_of_budget(&self) -> Error {
        Error::OutOfBudget { used: self.bytes(), max_bytes: self.max_bytes }
    }

    pub(crate) fn slot(&self, key: BlockKey) -> Option<usize> {
        self.slots.slot(key)
    }

    pub(crate) fn get(&self, key: BlockKey) -> Option<&VoxelBlock> {
        self.slots.get(key)?.block.as_deref()
    }

    pub(crate) fn history(&self, key: BlockKey) -> Option<BlockHistory> {
        self.slots.get(key).map(|slot| slot.history)
    }

    /// A block to be changed.
    pub(crate) fn get_mut(&mut self, key: BlockKey) -> Option<(&mut VoxelBlock, &mut BlockHistory)> {
        let stamp = self.clock.tick();
        let slot = self.slots.get_mut(key)?;
        slot.history.stamp = stamp;
        slot.block.as_deref_mut().map(|block| (block, &mut slot.history))
    }

    /// The keys in the order of their slots.
    pub(crate) fn keys(&self) -> &[BlockKey] {
        self.slots.keys()
    }

    /// Takes a block out of its slot, to be worked on; [`put`](Self::put) returns it.
    pub(crate) fn take(&mut self, slot: usize) -> Option<Box<VoxelBlock>> {
        self.slots.values_mut()[slot].block.take()
    }

    pub(crate) fn put(&mut self, slot: usize, block: Box<VoxelBlock>) {
        self.slots.values_mut()[slot].block = Some(block);
    }

    /// Notes that a block has changed.
    pub(crate) fn mark_changed(&mut self, slot: usize, call: u32) {
        let stamp = self.clock.tick();
        let history = &mut self.slots.values_mut()[slot].history;
        (history.stamp, history.call) = (stamp, call);
    }

    /// Notes that a call needs a block, if it is here.
    pub(crate) fn mark_used(&mut self, key: BlockKey, call: u32) {
        if let Some(slot) = self.slots.get_mut(key) {
            slot.history.call = call;
        }
    }

    /// Adds a block under a new key; the caller has seen that there is [`room`](Self::room).
    pub(crate) fn insert(&mut self, key: BlockKey, block: Box<VoxelBlock>, history: BlockHistory) {
        let history = BlockHistory { stamp: self.clock.tick(), ..history };
        self.slots.insert(key, Slot { block: Some(block), history });
    }

    pub(crate) fn remove(&mut self, key: BlockKey) -> Option<(Box<VoxelBlock>, BlockHistory)> {
        let slot = self.slots.remove(key)?;
        slot.block.map(|block| (block, slot.history))
    }

    /// Keys and histories in the order of the slots.
    pub(crate) fn histories(&self) -> impl Iterator<Item = (BlockKey, BlockHistory)> + '_ {
        self.slots.keys().iter().zip(self.slots.values()).map(|(&key, slot)| (key, slot.history))
    }

    /// All keys, ascending.
    pub(crate) fn sorted_keys(&self) -> Vec<BlockKey> {
        let mut keys = self.slots.keys().to_vec();
        keys.sort_unstable();
        keys
    }
}
