//! Where the blocks of a map are: in active memory, held until the caller has judged them, or cold.
//!
//! Sums add up, so a block may lie in several places at once: a copy that has left, and another one begun afresh when the
//! surface was seen again. The map is the sum of the copies, whenever and wherever they are brought together. What all
//! copies of a block sum up to always fits its counters: that is seen to when a frame is fused.

#[cfg(feature = "gpu")]
mod absorb;
mod change;
mod coder;
mod cold;
mod moves;
mod revisit;
mod swap;

pub(crate) use change::Moment;
pub(crate) use coder::{MOST_BYTES, pack};
use cold::Cold;
pub(crate) use cold::Label;
pub(crate) use moves::Moves;
pub(crate) use revisit::Waiting;
pub use revisit::{Arrivals, MergeAtOnce, Revisit, Verdict};
pub(crate) use swap::Swap;

use crate::block::{Block, MAX_COLOURS};
use crate::error::Error;
use crate::file::{BlockFile, Entry};
use crate::key::{Key, mix};
use crate::settings::Tiers as Limits;
use crate::slots::Slots;
use crate::store::{Seen, Store};

/// A block that has come back and waits to be merged.
pub(crate) struct Held {
    block: Box<Block>,
    seen: Seen,
    /// When it came.
    since: f64,
}

/// All copies of all blocks.
pub(crate) struct Copies {
    pub(crate) active: Store,
    pub(crate) held: Slots<Held>,
    pub(crate) cold: Cold,
    limits: Limits,
    /// Number of the current or last call.
    call: u32,
    /// How many blocks have ever been emptied.
    pub(crate) removed: u64,
}

impl Copies {
    pub(crate) fn new(max_bytes: usize, limits: Limits, swap: Option<Swap>) -> Result<Self, Error> {
        let (active, held) = (Store::new(max_bytes)?, Slots::new());
        Ok(Self { active, held, cold: Cold::new(limits.host_bytes, swap), limits, call: 0, removed: 0 })
    }

    /// Takes in the blocks of a file: as cold ones, or at once where there is no cold memory.
    pub(crate) fn open(&mut self, file: BlockFile, entries: &[Entry]) -> Result<(), Error> {
        if self.cold.exists() {
            return self.cold.open(file, entries);
        }
        let file = Cold::of_file(file, entries);
        for entry in entries {
            if self.active.room() == 0 {
                return Err(self.active.out_of_budget());
            }
            let mut block = Box::new(Block::ZERO);
            file.add_to(entry.key, &mut block)?;
            self.active.insert(entry.key, block, entry.label.seen());
        }
        Ok(())
    }

    /// Bytes of active memory, held blocks included.
    pub(crate) fn active_bytes(&self) -> usize {
        self.active.bytes() + self.held_bytes(0)
    }

    /// Bytes of the held blocks when `added` more are held, at the worst moment.
    fn held_bytes(&self, added: usize) -> usize {
        let count = self.held.len() + added;
        if count == 0 { 0 } else { self.held.bytes_with(added) + count * size_of::<Block>() }
    }

    /// Whether every block has one copy, in active memory.
    fn all_active(&self) -> bool {
        self.cold.is_empty() && self.held.len() == 0
    }

    /// The keys of the map, ascending.
    pub(crate) fn sorted_keys(&self) -> Vec<Key> {
        let mut keys = self.active.sorted_keys();
        if !self.all_active() {
            keys.extend(self.held.keys());
            keys.extend(self.cold.keys());
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
    pub(crate) fn contains(&self, key: Key) -> bool {
        self.active.slot(key).is_some() || self.held.get(key).is_some() || self.cold.contains(key)
    }

    /// Appends, once each, the blocks whose sum has changed since the clock of the active store stood at `stamp`; some
    /// that have only been moved may be among them.
    pub(crate) fn changed_since(&self, stamp: u64, changed: &mut Vec<Key>) {
        let later = |seen: &Seen| seen.stamp > stamp;
        changed.extend(self.active.sightings().filter(|(_, seen)| later(seen)).map(|(key, _)| key));
        if self.cold.latest() > stamp {
            changed.extend(self.cold.sightings().filter(|(_, seen)| later(seen)).map(|(key, _)| key));
            changed.sort_unstable();
            changed.dedup();
        }
    }

    /// A block: its only copy if that is there to be looked at, else the sum of all, which is added up in `sum`.
    pub(crate) fn sum<'a>(&'a self, key: Key, sum: &'a mut Block) -> Result<Option<&'a Block>, Error> {
        let (active, held) = (self.active.get(key), self.held.get(key));
        if self.all_active() || (held.is_none() && !self.cold.contains(key)) {
            return Ok(active);
        }
        if active.is_none()
            && held.is_none()
            && let Some(loose) = self.cold.loose.get(key)
        {
            return Ok(Some(loose));
        }
        self.total(key, sum)?;
        Ok(Some(sum))
    }

    /// The sum of all copies of a block, and what is known of it.
    pub(crate) fn total(&self, key: Key, sum: &mut Block) -> Result<Seen, Error> {
        *sum = Block::ZERO;
        let mut seen = self.cold.add_to(key, sum)?.unwrap_or_default();
        if let Some(held) = self.held.get(key) {
            sum.add(&held.block);
            seen = seen.with(held.seen);
        }
        if let Some((block, newer)) = self.active.get(key).zip(self.active.seen(key)) {
            sum.add(block);
            seen = seen.with(newer);
        }
        Ok(seen)
    }

    /// A hash of the sums of all copies, in the order of the keys.
    pub(crate) fn hash(&self) -> u64 {
        self.sorted_keys().into_iter().fold(0, |hash, key| {
            let copies = [
                self.active.get(key).map(Block::print),
                self.held.get(key).map(|held| held.block.print()),
                self.cold.print(key),
            ];
            let print = copies.into_iter().flatten().fold(0, u64::wrapping_add);
            fold(hash, key, print)
        })
    }

    /// Whether a block can be added to the other copies without running over.
    fn fits(&self, key: Key, block: &Block) -> Result<bool, Error> {
        let cold = self.cold.peaks(key);
        let held = self.held.get(key).map(|held| held.block.peaks());
        if cold.is_none() && held.is_none() {
            return Ok(true);
        }
        let peaks = [Some(block.peaks()), cold, held];
        let sum = |k: usize| peaks.iter().flatten().map(|peaks| u32::from(peaks[k])).sum::<u32>();
        if u16::try_from(sum(0)).is_ok() && sum(1) <= u32::from(MAX_COLOURS) {
            return Ok(true);
        }
        // The largest of each need not meet in one voxel.
        let mut all = Box::new(Block::ZERO);
        self.cold.add_to(key, &mut all)?;
        let fault = self.held.get(key).is_some_and(|held| all.add(&held.block));
        Ok(!(all.add(block) || fault))
    }
}

/// Folds a block, by its print, into the hash of a map.
pub(crate) fn fold(hash: u64, key: Key, print: u64) -> u64 {
    mix(mix(hash ^ key.0).wrapping_add(print))
}

impl Seen {
    /// Of the sum of two copies.
    pub(crate) fn with(self, other: Self) -> Self {
        let newer = if other.last > self.last { other } else { self };
        Self {
            frames: self.frames.saturating_add(other.frames),
            call: self.call.max(other.call),
            stamp: self.stamp.max(other.stamp),
            ..newer
        }
    }
}
