//! The mesh of a growing map, made again only where the map has changed.

use std::convert::Infallible;

use super::Mesh;
use super::cases::CASES;
use super::patch::{Bench, Patch, Scale};
use super::rows::Bits;
use super::weld::weld;
use crate::block::Block;
use crate::key::Key;
use crate::slots::Slots;
use crate::store::Store;
use crate::tiers::Copies;
use crate::{Error, Map};

/// Stands for blocks that no cell reaches into.
static NOWHERE: Block = Block::ZERO;

/// What [`MeshKeeper::update`] did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MeshReport {
    /// Blocks that have changed since the last call.
    pub changed: usize,
    /// Blocks that are no longer in the map.
    pub removed: usize,
    /// Blocks whose piece of the surface was made again: those and their lower neighbours.
    pub rebuilt: usize,
}

/// The mesh of a map, kept up to date at the cost of what has changed (thesis Paper I, section 4.6).
///
/// It is that of the whole map: blocks that leave active memory keep their piece of the surface, and blocks with copies
/// in several tiers are meshed by their sum. So [`mesh`](Self::mesh) equals `map.whole()?.mesh()` after every update, to
/// the bit and in the same order. A keeper that is shown another map starts anew.
///
/// ```
/// # use nalgebra::Isometry3;
/// # use tsdf_hash::{DepthData, DepthView, Intrinsics, Map, MeshKeeper, Settings};
/// # let depth = vec![1000_u16; 160 * 120];
/// # let intrinsics = Intrinsics { fx: 130.0, fy: 130.0, cx: 79.5, cy: 59.5 };
/// # let view = DepthView { width: 160, height: 120, data: DepthData::U16 { data: &depth, scale: 1000.0 }, intrinsics };
/// let (mut map, mut keeper) = (Map::new(Settings::default())?, MeshKeeper::new());
/// for step in 0..3 {
///     map.integrate(&view, None, &Isometry3::translation(0.1 * f64::from(step), 0.0, 0.0))?;
///     let report = keeper.update(&map)?;
///     assert!(report.changed > 0);
/// }
/// assert_eq!(keeper.mesh(), map.mesh());
/// assert_eq!(keeper.update(&map)?.rebuilt, 0);
/// # Ok::<(), tsdf_hash::Error>(())
/// ```
#[derive(Default)]
pub struct MeshKeeper {
    /// One for each block of the map.
    patches: Slots<Patch>,
    seen: Option<Moment>,
    /// Patches to be made again; they stay here when reading a block fails.
    dirty: Vec<Key>,
    changed: Vec<Key>,
    work: Work,
}

/// The state of the map at the last update.
#[derive(Clone, Copy, PartialEq)]
struct Moment {
    map: u64,
    stamp: u64,
    removed: u64,
}

/// Blocks to add up copies in, and the bench.
struct Work {
    bench: Bench,
    sums: Vec<Block>,
}

impl Default for Work {
    fn default() -> Self {
        Self { bench: Bench::new(), sums: vec![Block::ZERO; 8] }
    }
}

impl MeshKeeper {
    /// A keeper that has seen no map.
    pub fn new() -> Self {
        Self::default()
    }

    /// Follows the map.
    ///
    /// # Errors
    /// [`Error::Io`] and [`Error::Damaged`] when a block that is not in active memory cannot be read. The mesh is then
    /// up to date in part, and the next call goes on.
    pub fn update(&mut self, map: &Map) -> Result<MeshReport, Error> {
        let copies = &map.copies;
        let now = Moment { map: copies.active.id(), stamp: copies.active.clock(), removed: copies.removed };
        let since = self.seen.filter(|seen| seen.map == now.map);
        if since.is_none() {
            self.patches = Slots::new();
            self.dirty.clear();
        }
        let mut report = MeshReport::default();
        if since.is_some_and(|since| since.removed != now.removed) {
            report.removed = self.drop_removed(copies);
        }
        self.changed.clear();
        match since {
            Some(since) => copies.changed_since(since.stamp, &mut self.changed),
            None => self.changed.extend(copies.sorted_keys()),
        }
        report.changed = self.changed.len();
        self.mark_changed();
        report.rebuilt = self.rebuild(copies, &Scale::new(map.settings()))?;
        self.seen = Some(now);
        Ok(report)
    }

    /// The mesh, welded: one vertex per cut voxel edge, in the order of [`Map::mesh`].
    pub fn mesh(&self) -> Mesh {
        weld(&self.patches)
    }

    /// The mesh of the blocks in active memory.
    pub(crate) fn of_active(store: &Store, scale: &Scale) -> Mesh {
        let mut keeper = Self::new();
        keeper.changed.extend(store.keys());
        keeper.mark_changed();
        match keeper.rebuild(store, scale) {
            Ok(_) => keeper.mesh(),
            Err(never) => match never {},
        }
    }

    /// Forgets blocks that are gone from all tiers.
    fn drop_removed(&mut self, copies: &Copies) -> usize {
        let gone: Vec<Key> = self.patches.keys().iter().copied().filter(|&key| !copies.contains(key)).collect();
        for &key in &gone {
            self.patches.remove(key);
        }
        for &key in &gone {
            self.mark(key);
        }
        gone.len()
    }

    /// Marks what depends on the changed blocks.
    fn mark_changed(&mut self) {
        for key in std::mem::take(&mut self.changed) {
            match self.patches.get_mut(key) {
                Some(patch) => patch.unread = true,
                None => self.patches.insert(key, Patch { unread: true, ..Patch::default() }),
            }
            self.mark(key);
        }
    }

    /// Marks the patches whose cells reach into a block.
    fn mark(&mut self, key: Key) {
        for n in 0..8 {
            let Some(key) = key.neighbour([-(n & 1), -(n >> 1 & 1), -(n >> 2)]) else { continue };
            if let Some(patch) = self.patches.get_mut(key)
                && !patch.dirty
            {
                patch.dirty = true;
                self.dirty.push(key);
            }
        }
    }

    /// Makes the marked patches, the last first: then what lies above a block has been read before it, and much of it is
    /// still in the cache.
    fn rebuild<S: Source>(&mut self, source: &S, scale: &Scale) -> Result<usize, S::Fault> {
        self.dirty.sort_unstable();
        let mut rebuilt = 0;
        while let Some(&key) = self.dirty.last() {
            rebuilt += usize::from(self.rebuild_patch(key, source, scale)?);
            self.dirty.pop();
        }
        Ok(rebuilt)
    }

    fn rebuild_patch<S: Source>(&mut self, key: Key, source: &S, scale: &Scale) -> Result<bool, S::Fault> {
        // The block may have been removed since.
        let Some(patch) = self.patches.get_mut(key) else { return Ok(false) };
        if patch.unread {
            if let Some(block) = source.block(key, &mut self.work.sums[0])? {
                patch.bits = Bits::of(block);
            }
            patch.unread = false;
        }
        let upper = [0, 1, 2, 3, 4, 5, 6, 7].map(|n: i32| key.neighbour([n & 1, n >> 1 & 1, n >> 2]));
        let bits = upper.map(|key| self.patches.get(key?).map(|patch| patch.bits));
        let needed = self.work.bench.find(&bits);
        let mut blocks = [&NOWHERE; 8];
        for (n, (block, sum)) in blocks.iter_mut().zip(&mut self.work.sums).enumerate() {
            if let Some(key) = upper[n].filter(|_| needed >> n & 1 == 1)
                && let Some(found) = source.block(key, sum)?
            {
                *block = found;
            }
        }
        let Some(patch) = self.patches.get_mut(key) else { return Ok(false) };
        patch.dirty = false;
        if needed == 0 {
            patch.clear();
        } else {
            self.work.bench.make(patch, key, &blocks, &CASES, scale);
        }
        Ok(true)
    }
}

/// Where blocks are read from.
trait Source {
    /// Why they may not be read.
    type Fault;

    /// A block; `sum` is there to add up copies.
    fn block<'a>(&'a self, key: Key, sum: &'a mut Block) -> Result<Option<&'a Block>, Self::Fault>;
}

impl Source for Store {
    type Fault = Infallible;

    fn block<'a>(&'a self, key: Key, _: &'a mut Block) -> Result<Option<&'a Block>, Infallible> {
        Ok(self.get(key))
    }
}

impl Source for Copies {
    type Fault = Error;

    fn block<'a>(&'a self, key: Key, sum: &'a mut Block) -> Result<Option<&'a Block>, Error> {
        self.sum(key, sum)
    }
}

#[cfg(test)]
mod tests {
    use super::MeshKeeper;
    use crate::block::{Block, ONE, VOXELS};
    use crate::key::Key;
    use crate::store::Seen;
    use crate::{Map, Settings};

    #[test]
    fn a_change_of_one_voxel_reaches_every_cell_around_it() {
        let mut map = Map::new(Settings::default()).unwrap();
        // Two thirds of a voxel away: what is farther from a neighbour on the other side is torn.
        let near = ONE / 6;
        let free = Block { distance: [near; VOXELS], weight: [1; VOXELS], ..Block::ZERO };
        // 4 x 4 x 4 blocks on either side of the origin.
        for n in 0..64 {
            let key = Key::new([n % 4 - 2, n / 4 % 4 - 2, n / 16 - 2]).unwrap();
            map.copies.active.insert(key, Box::new(free.clone()), Seen::default());
        }
        let mut keeper = MeshKeeper::new();
        keeper.update(&map).unwrap();
        assert!(keeper.mesh().faces.is_empty());
        // One solid voxel, at each corner of a block in turn: eight cells in up to eight blocks, an octahedron.
        for corner in 0..8_usize {
            let voxel = [7, 7 * 8, 7 * 64].iter().enumerate().map(|(k, v)| if corner >> k & 1 == 1 { *v } else { 0 });
            let voxel = voxel.sum::<usize>();
            for (distance, faces) in [(-near, 8), (-ONE, 0), (near, 0)] {
                map.copies.active.get_mut(Key::new([0; 3]).unwrap()).unwrap().0.distance[voxel] = distance;
                assert_eq!(keeper.update(&map).unwrap().changed, 1);
                assert_eq!(keeper.mesh().faces.len(), faces, "corner {corner}");
                assert_eq!(keeper.mesh(), map.mesh());
            }
        }
    }
}
