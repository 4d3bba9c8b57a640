//! The blocks in active memory and the bytes they take.

use std::sync::atomic::{AtomicU64, Ordering};

use crate::Error;
use crate::block::Block;
use crate::key::Key;
use crate::slots::Slots;

/// The mesh names vertices by 32 bits, 1536 at most in a block.
const MOST_BLOCKS: usize = 1 << 21;

/// When a block was seen, and how often. No part of the exact state.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Seen {
    /// Time of the last frame that updated it, seconds.
    pub(crate) last: f64,
    /// Frames that updated it.
    pub(crate) frames: u32,
    /// Number of the last call that touched it.
    pub(crate) call: u32,
    /// When it last changed, on the clock of the [`Store`], which never stands still. It goes with the block to other
    /// tiers; moves may raise it without a change.
    pub(crate) stamp: u64,
}

struct Slot {
    block: Option<Box<Block>>,
    seen: Seen,
}

/// Stores of this process, to tell them apart.
static STORES: AtomicU64 = AtomicU64::new(0);

/// Blocks in dense slots, found through a hash table. A block is `None` only while a frame works on it.
pub(crate) struct Store {
    slots: Slots<Slot>,
    id: u64,
    clock: u64,
    max_bytes: usize,
    /// Blocks of the budget that are kept free, for work.
    spare: usize,
    /// Bytes of the budget that others use.
    pub(crate) set_aside: usize,
}

impl Store {
    pub(crate) fn new(max_bytes: usize) -> Result<Self, Error> {
        let most = max_bytes / size_of::<Block>();
        let id = STORES.fetch_add(1, Ordering::Relaxed);
        let spare = (most / 16).clamp(3, 256);
        let store = Self { slots: Slots::new(), id, clock: 0, max_bytes, spare, set_aside: 0 };
        if store.room() == 0 {
            let requirement = "large enough for one block and three to work with: 65536 bytes do";
            return Err(Error::InvalidSetting { name: "max_bytes", value: max_bytes as f64, requirement });
        }
        Ok(store)
    }

    pub(crate) fn len(&self) -> usize {
        self.slots.len()
    }

    pub(crate) fn bytes(&self) -> usize {
        self.slots.bytes() + self.len() * size_of::<Block>()
    }

    /// Blocks that may be in work outside the slots, three at least.
    pub(crate) fn spare(&self) -> usize {
        self.spare
    }

    /// The most blocks that can be added under the cap.
    pub(crate) fn room(&self) -> usize {
        let fits = |added: usize| {
            let blocks = self.len() + added + self.spare;
            self.slots.bytes_with(added) + blocks * size_of::<Block>() + self.set_aside <= self.max_bytes
        };
        // Growth of the table makes the need jump, so the bound is searched for: it is monotone in the number of blocks.
        let most = MOST_BLOCKS.saturating_sub(self.len()).min(self.max_bytes / size_of::<Block>());
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

    pub(crate) fn slot(&self, key: Key) -> Option<usize> {
        self.slots.slot(key)
    }

    pub(crate) fn get(&self, key: Key) -> Option<&Block> {
        self.block(self.slot(key)?)
    }

    pub(crate) fn block(&self, slot: usize) -> Option<&Block> {
        self.slots.values()[slot].block.as_deref()
    }

    pub(crate) fn seen(&self, key: Key) -> Option<Seen> {
        self.slots.get(key).map(|slot| slot.seen)
    }

    /// A block to be changed.
    pub(crate) fn get_mut(&mut self, key: Key) -> Option<(&mut Block, &mut Seen)> {
        let stamp = self.tick();
        let slot = self.slots.get_mut(key)?;
        slot.seen.stamp = stamp;
        slot.block.as_deref_mut().map(|block| (block, &mut slot.seen))
    }

    /// A number that no other store of this process has.
    pub(crate) fn id(&self) -> u64 {
        self.id
    }

    /// The latest stamp given.
    pub(crate) fn clock(&self) -> u64 {
        self.clock
    }

    /// A stamp that is later than all before.
    pub(crate) fn tick(&mut self) -> u64 {
        self.clock += 1;
        self.clock
    }

    /// The keys in the order of their slots.
    pub(crate) fn keys(&self) -> &[Key] {
        self.slots.keys()
    }

    /// Takes a block out of its slot, to be worked on; [`put`](Self::put) returns it.
    pub(crate) fn take(&mut self, slot: usize) -> Option<Box<Block>> {
        self.slots.values_mut()[slot].block.take()
    }

    pub(crate) fn put(&mut self, slot: usize, block: Box<Block>) {
        self.slots.values_mut()[slot].block = Some(block);
    }

    /// Notes that a block has changed.
    pub(crate) fn touch(&mut self, slot: usize, call: u32) {
        let stamp = self.tick();
        let seen = &mut self.slots.values_mut()[slot].seen;
        (seen.stamp, seen.call) = (stamp, call);
    }

    /// Adds a block under a new key; the caller has seen that there is [`room`](Self::room).
    pub(crate) fn insert(&mut self, key: Key, block: Box<Block>, seen: Seen) {
        let seen = Seen { stamp: self.tick(), ..seen };
        self.slots.insert(key, Slot { block: Some(block), seen });
    }

    pub(crate) fn remove(&mut self, key: Key) -> Option<(Box<Block>, Seen)> {
        let slot = self.slots.remove(key)?;
        slot.block.map(|block| (block, slot.seen))
    }

    /// Keys and sightings in the order of the slots.
    pub(crate) fn sightings(&self) -> impl Iterator<Item = (Key, Seen)> + '_ {
        self.slots.keys().iter().zip(self.slots.values()).map(|(&key, slot)| (key, slot.seen))
    }

    /// All keys, ascending.
    pub(crate) fn sorted_keys(&self) -> Vec<Key> {
        let mut keys = self.slots.keys().to_vec();
        keys.sort_unstable();
        keys
    }
}
