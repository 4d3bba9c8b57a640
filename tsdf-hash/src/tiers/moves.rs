//! Blocks on their way between the tiers (thesis Paper I, section 4.3, steps (a), (c), (d)). No move changes a sum.

use super::{Copies, Held};
use crate::block::Block;
use crate::error::Error;
use crate::key::Key;

/// How many blocks moved.
#[derive(Clone, Copy, Default)]
pub(crate) struct Moves {
    pub(crate) left: usize,
    pub(crate) arrived: usize,
    pub(crate) overdue: usize,
}

impl Copies {
    /// Moves after a frame: what it saw again comes back, what has not been seen for long leaves. A move that finds no
    /// room, or a disk that fails, is left for later: the blocks stay where they are.
    pub(crate) fn settle(&mut self, touched: &[Key], time: f64) -> Moves {
        let overdue = self.held.values().iter().any(|held| time - held.since >= self.limits.hold);
        let overdue = if overdue { self.merge_held().unwrap_or_default() } else { 0 };
        Moves { overdue, arrived: self.arrive(touched, time), left: self.leave(time) }
    }

    /// Step (a): what has not been updated for long leaves, the oldest first.
    fn leave(&mut self, time: f64) -> usize {
        if !self.cold.exists() {
            return 0;
        }
        let mut old: Vec<_> = self
            .active
            .sightings()
            .filter(|(_, seen)| time - seen.last > self.limits.age)
            .map(|(key, seen)| (Order(seen.last), key))
            .collect();
        if old.len() > self.limits.transfers {
            old.select_nth_unstable(self.limits.transfers);
            old.truncate(self.limits.transfers);
        }
        old.sort_unstable();
        old.into_iter().take_while(|&(_, key)| self.send_away(key).is_ok()).count()
    }

    /// Steps (c) and (d): cold copies of what the frame touched come back.
    fn arrive(&mut self, touched: &[Key], time: f64) -> usize {
        if self.cold.is_empty() {
            return 0;
        }
        let mut arrived = 0;
        for &key in touched {
            if arrived == self.limits.transfers {
                break;
            }
            if self.cold.contains(key) && self.bring_back(key, time).unwrap_or(false) {
                arrived += 1;
            }
        }
        arrived
    }

    /// Brings a cold copy into active memory, or to the held ones; `false` if there is no room to hold it.
    fn bring_back(&mut self, key: Key, time: f64) -> Result<bool, Error> {
        let (block, seen) = if self.limits.hold == 0.0 {
            let Some(copy) = self.active.get_mut(key) else { return Ok(false) };
            copy
        } else {
            if self.held.get(key).is_none() {
                if self.active.room() < 2 {
                    return Ok(false);
                }
                let block = Box::new(Block::ZERO);
                self.held.insert(key, Held { block, seen: crate::store::Seen::default(), since: time });
                self.active.set_aside = self.held_bytes(1);
            }
            let Some(held) = self.held.get_mut(key) else { return Ok(false) };
            (&mut *held.block, &mut held.seen)
        };
        if let Some(older) = self.cold.add_to(key, block)? {
            *seen = older.with(*seen);
            self.cold.remove(key);
        }
        Ok(true)
    }

    /// Ends the quarantine: returns how many blocks were held.
    pub(crate) fn merge_held(&mut self) -> Result<usize, Error> {
        let mut keys = self.held.keys().to_vec();
        keys.sort_unstable();
        let count = keys.len();
        for key in keys {
            self.unhold(key)?;
        }
        Ok(count)
    }

    /// Merges a held block into its active copy, or makes it the active copy, or puts it away if there is no room.
    pub(crate) fn unhold(&mut self, key: Key) -> Result<(), Error> {
        let Some(held) = self.held.remove(key) else { return Ok(()) };
        self.active.set_aside = self.held_bytes(1);
        if let Some((block, seen)) = self.active.get_mut(key) {
            block.add(&held.block);
            *seen = held.seen.with(*seen);
        } else if self.active.room() > 0 {
            self.active.insert(key, held.block, held.seen);
        } else {
            return self.put_held_away(key, held);
        }
        Ok(())
    }

    fn put_held_away(&mut self, key: Key, held: Held) -> Result<(), Error> {
        let Held { block, seen, since } = held;
        let put = self.cold.put(key, block, seen).map_err(|(block, error)| {
            self.held.insert(key, Held { block, seen, since });
            error
        });
        self.active.set_aside = self.held_bytes(1);
        put
    }

    /// Sends away up to `count` blocks that the current call has not touched, by age, then by distance; then held ones.
    pub(crate) fn make_room(&mut self, count: usize, eye: [f64; 3]) -> Result<(), Error> {
        if !self.cold.exists() {
            return Ok(());
        }
        let mut victims: Vec<_> = self
            .active
            .sightings()
            .filter(|(_, seen)| seen.call != self.call)
            .map(|(key, seen)| (Order(seen.last), Order(-distance(key, eye)), key))
            .collect();
        if victims.len() > count {
            victims.select_nth_unstable(count);
            victims.truncate(count);
        }
        victims.sort_unstable();
        for &(_, _, key) in &victims {
            self.send_away(key)?;
        }
        let mut held = self.held.keys().to_vec();
        held.sort_unstable();
        for key in held.into_iter().take(count - victims.len()) {
            if let Some(held) = self.held.remove(key) {
                self.put_held_away(key, held)?;
            }
        }
        Ok(())
    }

    /// Moves an active block to cold memory, into its copy there if it has one.
    fn send_away(&mut self, key: Key) -> Result<(), Error> {
        let Some((block, seen)) = self.active.remove(key) else { return Ok(()) };
        self.cold.put(key, block, seen).map_err(|(block, error)| {
            self.active.insert(key, block, seen);
            error
        })
    }

    /// How many blocks [`make_room`](Self::make_room) can send away at most.
    pub(super) fn movable(&self) -> usize {
        if !self.cold.exists() {
            return 0;
        }
        self.active.sightings().filter(|(_, seen)| seen.call != self.call).count() + self.held.len()
    }
}

/// Squared distance of a block from the eye, in blocks.
fn distance(key: Key, eye: [f64; 3]) -> f64 {
    key.block().iter().zip(eye).map(|(&c, e)| (f64::from(c) + 0.5 - e).powi(2)).sum()
}

/// Finite numbers in their order.
#[derive(Clone, Copy, PartialEq)]
pub(super) struct Order(pub(super) f64);

impl Eq for Order {}

impl Ord for Order {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0)
    }
}

impl PartialOrd for Order {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}
