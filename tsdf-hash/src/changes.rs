//! Which blocks of a map have changed: what the mesh and the distance field follow a map by.

use std::sync::atomic::{AtomicU64, Ordering};

/// The state of a map at some time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MapVersion {
    /// A number that no other map of this process has: see [`MapVersion::unique`].
    pub map: u64,
    /// Grows with every change of a block.
    pub stamp: u64,
    /// How many blocks have ever been removed.
    pub removed: u64,
}

impl MapVersion {
    /// The first version of a new map.
    pub fn unique() -> Self {
        static MAPS: AtomicU64 = AtomicU64::new(0);
        Self { map: MAPS.fetch_add(1, Ordering::Relaxed), stamp: 0, removed: 0 }
    }
}

/// What has changed in a map since an earlier version.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BlockChanges {
    /// The version now.
    pub version: MapVersion,
    /// Whether the earlier version was none of this map: then all blocks are listed, and nothing else is left of what was
    /// known before.
    pub is_new_map: bool,
    /// Whether blocks have been removed.
    pub any_removed: bool,
    /// Coordinates of the blocks that were added or have changed, once each; some that have not changed may be among them.
    pub changed: Vec<[i32; 3]>,
}

impl BlockChanges {
    /// From the stamp at which a block last changed: `since` gives the blocks with later stamps, all of them for `None`.
    pub fn new(
        version: MapVersion,
        before: Option<MapVersion>,
        since: impl FnOnce(Option<u64>) -> Vec<[i32; 3]>,
    ) -> Self {
        let before = before.filter(|before| before.map == version.map);
        Self {
            version,
            is_new_map: before.is_none(),
            any_removed: before.is_some_and(|before| before.removed != version.removed),
            changed: since(before.map(|before| before.stamp)),
        }
    }
}

/// The version of a map in the making.
#[derive(Debug)]
pub(crate) struct ChangeClock(MapVersion);

impl ChangeClock {
    pub(crate) fn new() -> Self {
        Self(MapVersion::unique())
    }

    pub(crate) fn version(&self) -> MapVersion {
        self.0
    }

    /// A stamp that is later than all before.
    pub(crate) fn tick(&mut self) -> u64 {
        self.0.stamp += 1;
        self.0.stamp
    }

    pub(crate) fn count_removed(&mut self, blocks: usize) {
        self.0.removed += blocks as u64;
    }
}
