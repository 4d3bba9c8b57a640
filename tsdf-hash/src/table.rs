//! From a block's key to its slot.

use crate::key::Key;

/// Never the word of a key: those have 63 bits.
const FREE: u64 = u64::MAX;
const ENTRY_BYTES: usize = size_of::<u64>() + size_of::<u32>();
const LEAST: usize = 64;

/// Open addressing with linear probing, at most half full; removal shifts the cluster back, so there are no tombstones.
pub(crate) struct Table {
    keys: Vec<u64>,
    slots: Vec<u32>,
    len: usize,
}

impl Table {
    pub(crate) fn new() -> Self {
        Self { keys: vec![FREE; LEAST], slots: vec![0; LEAST], len: 0 }
    }

    /// Bytes of a table that can hold `len` keys.
    pub(crate) fn bytes_for(len: usize) -> usize {
        Self::entries_for(len) * ENTRY_BYTES
    }

    fn entries_for(len: usize) -> usize {
        (2 * len).next_power_of_two().max(LEAST)
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
        let old_keys = std::mem::replace(&mut self.keys, vec![FREE; entries]);
        let old_slots = std::mem::replace(&mut self.slots, vec![0; entries]);
        self.len = 0;
        for (key, slot) in old_keys.into_iter().zip(old_slots).filter(|&(key, _)| key != FREE) {
            self.set(Key(key), slot);
        }
    }

    pub(crate) fn get(&self, key: Key) -> Option<usize> {
        let at = self.find(key);
        (self.keys[at] != FREE).then(|| self.slots[at] as usize)
    }

    /// Inserts or overwrites. The caller has reserved the room.
    pub(crate) fn set(&mut self, key: Key, slot: u32) {
        let at = self.find(key);
        if self.keys[at] == FREE {
            self.len += 1;
            self.keys[at] = key.0;
        }
        self.slots[at] = slot;
    }

    pub(crate) fn remove(&mut self, key: Key) {
        let mut hole = self.find(key);
        if self.keys[hole] == FREE {
            return;
        }
        self.len -= 1;
        let mask = self.keys.len() - 1;
        let mut at = hole;
        loop {
            at = (at + 1) & mask;
            if self.keys[at] == FREE {
                break;
            }
            // An entry may fill the hole unless its home lies cyclically between the hole and itself.
            let home = Key(self.keys[at]).mixed() as usize & mask;
            if at.wrapping_sub(home) & mask >= at.wrapping_sub(hole) & mask {
                self.keys[hole] = self.keys[at];
                self.slots[hole] = self.slots[at];
                hole = at;
            }
        }
        self.keys[hole] = FREE;
    }

    /// The entry of the key, or the free one where it would go.
    fn find(&self, key: Key) -> usize {
        let mask = self.keys.len() - 1;
        let mut at = key.mixed() as usize & mask;
        while self.keys[at] != FREE && self.keys[at] != key.0 {
            at = (at + 1) & mask;
        }
        at
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::Table;
    use crate::key::{Key, mix};

    #[test]
    fn behaves_like_an_ordered_map_under_random_use() {
        let (mut table, mut oracle) = (Table::new(), BTreeMap::new());
        for step in 0..20_000_u64 {
            let r = mix(step + 1);
            // 300 keys in 1024 entries: long clusters, many removals inside them.
            let key = Key(r % 300);
            table.reserve(oracle.len() + 1);
            if r >> 60 < 9 {
                table.set(key, step as u32);
                oracle.insert(key, step as usize);
            } else {
                table.remove(key);
                oracle.remove(&key);
            }
            let probe = Key(mix(r) % 300);
            assert_eq!(table.get(probe), oracle.get(&probe).copied());
        }
        assert_eq!(table.len, oracle.len());
        assert!(oracle.iter().all(|(&key, &slot)| table.get(key) == Some(slot)));
    }
}
