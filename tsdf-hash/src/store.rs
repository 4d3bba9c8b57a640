//! The blocks of a map and the bytes they take.

use crate::Error;
use crate::block::Block;
use crate::key::Key;
use crate::table::Table;

/// Slots are added this many at a time, so that the list of slots is rarely copied.
const STEP: usize = 1024;
/// The mesh names vertices by 32 bits, 1536 at most in a block.
const MOST_BLOCKS: usize = 1 << 21;
const SLOT_BYTES: usize = size_of::<Key>() + size_of::<Option<Box<Block>>>() + size_of::<u64>();

/// Blocks in dense slots, found through a hash table. A block is `None` only while a frame works on it.
pub(crate) struct Store {
    table: Table,
    keys: Vec<Key>,
    blocks: Vec<Option<Box<Block>>>,
    /// When a block last changed, on a clock that never stands still: equal stamps mean equal blocks.
    stamps: Vec<u64>,
    clock: u64,
    max_bytes: usize,
}

impl Store {
    pub(crate) fn new(max_bytes: usize) -> Result<Self, Error> {
        let store =
            Self { table: Table::new(), keys: Vec::new(), blocks: Vec::new(), stamps: Vec::new(), clock: 0, max_bytes };
        let least = store.bytes_with(1);
        if least > max_bytes {
            let requirement = "large enough for one block: 32768 bytes do";
            return Err(Error::InvalidSetting { name: "max_bytes", value: max_bytes as f64, requirement });
        }
        Ok(store)
    }

    pub(crate) fn len(&self) -> usize {
        self.keys.len()
    }

    pub(crate) fn bytes(&self) -> usize {
        self.table.bytes() + self.keys.capacity() * SLOT_BYTES + self.len() * size_of::<Block>()
    }

    /// Bytes at the worst moment of adding `added` blocks: a table or list that grows stands beside its old self.
    fn bytes_with(&self, added: usize) -> usize {
        let len = self.len() + added;
        let table = match Table::bytes_for(len) {
            bytes if bytes > self.table.bytes() => bytes + self.table.bytes(),
            _ => self.table.bytes(),
        };
        let slots = match len.next_multiple_of(STEP) {
            slots if slots > self.keys.capacity() => slots + self.keys.capacity(),
            _ => self.keys.capacity(),
        };
        table + slots * SLOT_BYTES + len * size_of::<Block>()
    }

    /// The most blocks that can be added under the cap.
    pub(crate) fn room(&self) -> usize {
        let mut room = MOST_BLOCKS.saturating_sub(self.len()).min(self.max_bytes / size_of::<Block>());
        // Growth of the table makes the need jump, so the bound is searched for: it is monotone in the number of blocks.
        let (mut fits, mut fails) = (0, room + 1);
        while fits + 1 < fails {
            room = usize::midpoint(fits, fails);
            if self.bytes_with(room) <= self.max_bytes { fits = room } else { fails = room }
        }
        fits
    }

    pub(crate) fn out_of_budget(&self) -> Error {
        Error::OutOfBudget { used: self.bytes(), max_bytes: self.max_bytes }
    }

    pub(crate) fn slot(&self, key: Key) -> Option<usize> {
        self.table.get(key)
    }

    pub(crate) fn get(&self, key: Key) -> Option<&Block> {
        self.block(self.slot(key)?)
    }

    pub(crate) fn block(&self, slot: usize) -> Option<&Block> {
        self.blocks[slot].as_deref()
    }

    /// Takes a block out of its slot, to be worked on; [`put`](Self::put) returns it.
    pub(crate) fn take(&mut self, key: Key) -> Option<Box<Block>> {
        self.table.get(key).and_then(|slot| self.blocks[slot].take())
    }

    pub(crate) fn put(&mut self, key: Key, block: Box<Block>) {
        if let Some(slot) = self.table.get(key) {
            self.blocks[slot] = Some(block);
        }
    }

    /// Adds blocks under new keys; the caller has seen that there is [`room`](Self::room).
    pub(crate) fn add(&mut self, added: Vec<(Key, Box<Block>)>) {
        let len = self.len() + added.len();
        let slots = len.next_multiple_of(STEP);
        if slots > self.keys.capacity() {
            self.keys.reserve_exact(slots - self.keys.len());
            self.blocks.reserve_exact(slots - self.blocks.len());
            self.stamps.reserve_exact(slots - self.stamps.len());
        }
        self.table.reserve(len);
        for (key, block) in added {
            self.table.set(key, self.keys.len() as u32);
            self.keys.push(key);
            self.blocks.push(Some(block));
            self.clock += 1;
            self.stamps.push(self.clock);
        }
    }

    /// Notes that a block has changed.
    pub(crate) fn touch(&mut self, key: Key) {
        if let Some(slot) = self.table.get(key) {
            self.clock += 1;
            self.stamps[slot] = self.clock;
        }
    }

    /// A number that changes whenever the block does; no two blocks of a store ever share one.
    pub(crate) fn stamp(&self, slot: usize) -> u64 {
        self.stamps[slot]
    }

    /// The keys in the order of their slots.
    pub(crate) fn keys(&self) -> &[Key] {
        &self.keys
    }

    pub(crate) fn remove(&mut self, key: Key) {
        let Some(slot) = self.table.get(key) else { return };
        self.table.remove(key);
        self.keys.swap_remove(slot);
        self.blocks.swap_remove(slot);
        self.stamps.swap_remove(slot);
        if let Some(&moved) = self.keys.get(slot) {
            self.table.set(moved, slot as u32);
        }
    }

    /// All keys, ascending.
    pub(crate) fn sorted_keys(&self) -> Vec<Key> {
        let mut keys = self.keys.clone();
        keys.sort_unstable();
        keys
    }
}
