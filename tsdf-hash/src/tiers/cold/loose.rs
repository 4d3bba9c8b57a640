//! Blocks of the host tier that are not packed: while there is room, a block stays as it left active memory.

use crate::block::Block;
use crate::key::Key;
use crate::slots::Slots;
use crate::store::Seen;
use crate::tiers::moves::Order;

/// How many blocks are looked out at once to be packed.
const BATCH: usize = 64;
/// Bytes of their list.
pub(super) const BATCH_BYTES: usize = BATCH * size_of::<Age>();

struct Slot {
    block: Option<Box<Block>>,
    seen: Seen,
}

/// Blocks in dense slots, found through a hash table. A block is `None` only while a frame works on it.
pub(crate) struct Loose {
    slots: Slots<Slot>,
    /// The oldest when they were last looked for, the very oldest last.
    oldest: Vec<Age>,
    /// Number of the current call: what it is about to touch is packed last.
    call: u32,
}

/// What is packed first.
type Age = (bool, Order, Key);

impl Loose {
    pub(super) fn new() -> Self {
        Self { slots: Slots::new(), oldest: Vec::new(), call: 0 }
    }

    pub(super) fn len(&self) -> usize {
        self.slots.len()
    }

    /// Bytes of the blocks and their index at the worst moment of adding so many.
    pub(super) fn bytes_with(&self, added: usize) -> usize {
        self.slots.bytes_with(added) + (self.len() + added) * size_of::<Block>()
    }

    pub(super) fn keys(&self) -> &[Key] {
        self.slots.keys()
    }

    pub(super) fn sightings(&self) -> impl Iterator<Item = (Key, Seen)> + '_ {
        self.slots.keys().iter().zip(self.slots.values()).map(|(&key, slot)| (key, slot.seen))
    }

    pub(crate) fn get(&self, key: Key) -> Option<&Block> {
        self.slots.get(key)?.block.as_deref()
    }

    pub(crate) fn seen(&self, key: Key) -> Option<Seen> {
        self.slots.get(key).filter(|slot| slot.block.is_some()).map(|slot| slot.seen)
    }

    pub(super) fn set_seen(&mut self, key: Key, seen: Seen) {
        if let Some(slot) = self.slots.get_mut(key) {
            slot.seen = seen;
        }
    }

    /// Whether a block is here; it is then noted that the current call is about to touch it.
    pub(crate) fn note(&mut self, key: Key, call: u32) -> bool {
        self.call = call;
        let slot = self.slots.get_mut(key);
        slot.map(|slot| slot.seen.call = call).is_some()
    }

    /// Takes a block out of its slot, to be worked on; [`put`](Self::put) returns it.
    pub(crate) fn take(&mut self, key: Key) -> Option<(usize, Box<Block>)> {
        let slot = self.slots.slot(key)?;
        Some((slot, self.slots.values_mut()[slot].block.take()?))
    }

    pub(crate) fn put(&mut self, slot: usize, block: Box<Block>) {
        self.slots.values_mut()[slot].block = Some(block);
    }

    pub(super) fn reserve(&mut self, added: usize) {
        self.slots.reserve(added);
    }

    pub(super) fn insert(&mut self, key: Key, block: Box<Block>, seen: Seen) {
        self.slots.insert(key, Slot { block: Some(block), seen });
    }

    pub(super) fn remove(&mut self, key: Key) -> bool {
        let found = self.slots.remove(key).is_some();
        if found && self.len() == 0 {
            // An index that has grown is given back.
            *self = Self { call: self.call, ..Self::new() };
        }
        found
    }

    /// The block that no frame has seen for longest, by its age when it was last looked at.
    pub(super) fn oldest(&mut self) -> Option<Key> {
        loop {
            while let Some(age) = self.oldest.pop() {
                if self.seen(age.2).is_some_and(|seen| self.age(age.2, seen) == age) {
                    return Some(age.2);
                }
            }
            if self.len() == 0 {
                return None;
            }
            let mut all: Vec<Age> = self.sightings().map(|(key, seen)| self.age(key, seen)).collect();
            if all.len() > BATCH {
                all.select_nth_unstable(BATCH);
                all.truncate(BATCH);
            }
            all.sort_unstable();
            self.oldest.reserve_exact(BATCH);
            self.oldest.extend(all.into_iter().rev());
        }
    }

    fn age(&self, key: Key, seen: Seen) -> Age {
        (seen.call == self.call, Order(seen.last), key)
    }
}
