//! Voxel-hashing table: from the key of a block to its slot.

use crate::blocks::block_key::BlockKey;

/// Never the word of a key: those have 63 bits.
const EMPTY: u64 = u64::MAX;
const ENTRY_BYTES: usize = size_of::<u64>() + size_of::<u32>();
const MIN_ENTRIES: usize = 64;

/// Open addressing with linear probing, at most half full; removal shifts the cluster back, so there are no tombstones.
pub(crate) struct HashTable {
    keys: Vec<u64>,
    slots: Vec<u32>,
    len: usize,
}

impl HashTable {
    pub(crate) fn new() -> Self {
        Self { keys: vec![EMPTY; MIN_ENTRIES], slots: vec![0; MIN_ENTRIES], len: 0 }
    }

    /// Bytes of a table that can hold `len` keys.
    pub(crate) fn bytes_for(len: usize) -> usize {
        Self::entries_for(len) * ENTRY_BYTES
    }

    fn entries_for(len: usize) -> usize {
        (2 * len).next_power_of_two().max(MIN_ENTRIES)
    }

    pub(crate) fn bytes(&self) -> usize {
        self.keys.len() * ENTRY_BYTES
    }

    /// Makes room for `len` keys in all.
    pub(crate) fn reserve(&mut self, len: usize) {
        let entries = Self::entries_for(len);
        if entries <= self.keys.len() {
            return;
        }
        let old_keys = std::mem::replace(&mut self.keys, vec![EMPTY; entries]);
        let old_slots = std::mem::replace(&mut self.slots, vec![0; entries]);
        self.len = 0;
        for (key, slot) in old_keys.into_iter().zip(old_slots).filter(|&(key, _)| key != EMPTY) {
            self.set(BlockKey(key), slot);
        }
    }

    pub(crate) fn get(&self, key: BlockKey) -> Option<usize> {
        let at = self.find(key);
        (self.keys[at] != EMPTY).then(|| self.slots[at] as usize)
    }

    /// Inserts or overwrites. The caller has reserved the room.
    pub(crate) fn set(&mut self, key: BlockKey, slot: u32) {
        let at = self.find(key);
        if self.keys[at] == EMPTY {
            self.len += 1;
            self.keys[at] = key.0;
        }
        self.slots[at] = slot;
    }

    pub(crate) fn remove(&mut self, key: BlockKey) {
        let mut gap = self.find(key);
        if self.keys[gap] == EMPTY {
            return;
        }
        self.len -= 1;
        let mask = self.keys.len() - 1;
        let mut at = gap;
        loop {
            at = (at + 1) & mask;
            if self.keys[at] == EMPTY {
                break;
            }
            // An entry may fill the gap unless the place of its hash is cyclically between the gap and itself.
            let hashed = BlockKey(self.keys[at]).hashed() as usize & mask;
            if at.wrapping_sub(hashed) & mask >= at.wrapping_sub(gap) & mask {
                self.keys[gap] = self.keys[at];
                self.slots[gap] = self.slots[at];
                gap = at;
            }
        }
        self.keys[gap] = EMPTY;
    }

    /// The entry of the key, or the free one where it would go.
    fn find(&self, key: BlockKey) -> usize {
        let mask = self.keys.len() - 1;
        let mut at = key.hashed() as usize & mask;
        while self.keys[at] != EMPTY && self.keys[at] != key.0 {
            at = (at + 1) & mask;
        }
        at
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::HashTable;
    use crate::blocks::block_key::BlockKey;
    use crate::hashing::mix64;

    #[test]
    fn behaves_like_an_ordered_map_under_random_use() {
        let (mut table, mut oracle) = (HashTable::new(), BTreeMap::new());
        for step in 0..20_000_u64 {
            let r = mix64(step + 1);
            // 300 keys in 1024 entries: long clusters, many removals inside them.
            let key = BlockKey(r % 300);
            table.reserve(oracle.len() + 1);
            if r >> 60 < 9 {
                table.set(key, step as u32);
                oracle.insert(key, step as usize);
            } else {
                table.remove(key);
                oracle.remove(&key);
            }
            let probe = BlockKey(mix64(r) % 300);
            assert_eq!(table.get(probe), oracle.get(&probe).copied());
        }
        assert_eq!(table.len, oracle.len());
        assert!(oracle.iter().all(|(&key, &slot)| table.get(key) == Some(slot)));
    }
}
