//! Values by block key, in dense slots found through the hash table.

use crate::blocks::block_key::BlockKey;
use crate::blocks::hash_table::HashTable;

/// Smallest capacity of a table that holds anything.
const MIN_CAPACITY: usize = 64;

/// Keys and values in slots `0..len`, found through a hash table. Removal moves the last one into the gap.
pub(crate) struct BlockTable<V> {
    table: HashTable,
    keys: Vec<BlockKey>,
    values: Vec<V>,
}

impl<V> Default for BlockTable<V> {
    fn default() -> Self {
        Self::new()
    }
}

impl<V> BlockTable<V> {
    const SLOT_BYTES: usize = size_of::<BlockKey>() + size_of::<V>();

    pub(crate) fn new() -> Self {
        Self { table: HashTable::new(), keys: Vec::new(), values: Vec::new() }
    }

    pub(crate) fn len(&self) -> usize {
        self.keys.len()
    }

    /// Bytes of the table and of the slots; not those the values point to.
    pub(crate) fn bytes(&self) -> usize {
        self.table.bytes() + self.keys.capacity() * Self::SLOT_BYTES
    }

    /// The same at the worst moment of inserting `added` more: what grows stands beside its old self.
    pub(crate) fn bytes_with(&self, added: usize) -> usize {
        let len = self.len() + added;
        let grown = |needed: usize, now: usize| if needed > now { needed + now } else { now };
        let slots = grown(Self::capacity_for(len), self.keys.capacity());
        grown(HashTable::bytes_for(len), self.table.bytes()) + slots * Self::SLOT_BYTES
    }

    /// A list grows by a quarter, so that it is rarely copied and never mostly empty.
    fn capacity_for(len: usize) -> usize {
        let mut capacity = MIN_CAPACITY;
        while capacity < len {
            capacity += capacity / 4;
        }
        if len == 0 { 0 } else { capacity }
    }

    pub(crate) fn slot(&self, key: BlockKey) -> Option<usize> {
        self.table.get(key)
    }

    pub(crate) fn get(&self, key: BlockKey) -> Option<&V> {
        self.slot(key).map(|slot| &self.values[slot])
    }

    pub(crate) fn get_mut(&mut self, key: BlockKey) -> Option<&mut V> {
        self.slot(key).map(|slot| &mut self.values[slot])
    }

    pub(crate) fn keys(&self) -> &[BlockKey] {
        &self.keys
    }

    pub(crate) fn values(&self) -> &[V] {
        &self.values
    }

    pub(crate) fn values_mut(&mut self) -> &mut [V] {
        &mut self.values
    }

    /// Makes room for `added` more at once.
    pub(crate) fn reserve(&mut self, added: usize) {
        let len = self.len() + added;
        if len > self.keys.capacity() {
            let more = Self::capacity_for(len) - self.len();
            self.keys.reserve_exact(more);
            self.values.reserve_exact(more);
        }
        self.table.reserve(len);
    }

    /// Inserts a key that is not there yet.
    pub(crate) fn insert(&mut self, key: BlockKey, value: V) {
        self.reserve(1);
        self.table.set(key, self.len() as u32);
        self.keys.push(key);
        self.values.push(value);
    }

    pub(crate) fn remove(&mut self, key: BlockKey) -> Option<V> {
        let slot = self.table.get(key)?;
        self.table.remove(key);
        self.keys.swap_remove(slot);
        let value = self.values.swap_remove(slot);
        if let Some(&moved) = self.keys.get(slot) {
            self.table.set(moved, slot as u32);
        }
        Some(value)
    }
}
