//! What is seen again is not fused before the caller has compared it (thesis Paper I, sections 4.3 and 4.5).

use nalgebra::Point3;

use super::Held;
use crate::Map;
use crate::block::Block;
use crate::key::Key;
use crate::query::Cell;
use crate::slots::Slots;

/// What to do with blocks that have come back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// The new frames agree with them, or have been corrected: add them to the active map.
    Merge,
    /// Keep them apart for now; [`Tiers::hold`](crate::Tiers::hold) limits how long.
    Hold,
}

/// Decides about blocks that have come back. A closure will do.
pub trait Revisit {
    /// Looks at the blocks that wait. Compare [`Arrivals::distance`] with [`Map::distance`] on the same surface, or
    /// align the two, to find how far the pose has drifted since.
    fn judge(&mut self, arrivals: &Arrivals) -> Verdict;
}

impl<F: FnMut(&Arrivals) -> Verdict> Revisit for F {
    fn judge(&mut self, arrivals: &Arrivals) -> Verdict {
        self(arrivals)
    }
}

/// For poses without drift: what comes back is merged.
#[derive(Clone, Copy, Debug, Default)]
pub struct MergeAtOnce;

impl Revisit for MergeAtOnce {
    fn judge(&mut self, _: &Arrivals) -> Verdict {
        Verdict::Merge
    }
}

/// The blocks that have come back and wait to be merged: the old surface, apart from the new one.
pub struct Arrivals<'a> {
    pub(crate) held: &'a Slots<Held>,
    pub(crate) active: &'a Map,
}

/// A block that waits, told from what it was before it left again, or before more of it came.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Waiting {
    pub(crate) key: Key,
    /// Bits of the time when it came.
    since: u64,
    /// Frames in it.
    frames: u32,
}

impl Arrivals<'_> {
    /// How many blocks wait.
    pub fn len(&self) -> usize {
        self.held.len()
    }

    /// Whether none waits.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// When the first of them came, seconds; `None` if none waits.
    pub fn since(&self) -> Option<f64> {
        self.held.values().iter().map(|held| held.since).reduce(f64::min)
    }

    /// Block coordinates, ascending; the block `b` spans `8h b .. 8h (b + 1)`.
    pub fn blocks(&self) -> Vec<[i32; 3]> {
        let mut keys = self.held.keys().to_vec();
        keys.sort_unstable();
        keys.into_iter().map(Key::block).collect()
    }

    /// Signed distance from the old surface, metres, as [`Map::distance`].
    pub fn distance(&self, point_in_world: &Point3<f64>) -> Option<f64> {
        Cell::around(self.active.settings(), |key| self.block(key), point_in_world).map(|cell| cell.distance())
    }

    /// The map that they would be merged into: the new surface.
    pub fn map(&self) -> &Map {
        self.active
    }

    /// The blocks and how they are, ascending.
    pub(crate) fn waiting(&self) -> Vec<Waiting> {
        let held = self.held.keys().iter().zip(self.held.values());
        let waiting =
            |(&key, held): (&Key, &Held)| Waiting { key, since: held.since.to_bits(), frames: held.seen.frames };
        let mut all: Vec<_> = held.map(waiting).collect();
        all.sort_unstable();
        all
    }

    /// The old copy of a block, for ray casting.
    pub(crate) fn block(&self, key: Key) -> Option<&Block> {
        self.held.get(key).map(|held| &*held.block)
    }
}
