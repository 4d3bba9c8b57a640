//! Distances far from surfaces: an exact Euclidean distance field that follows the map.

mod patch;
mod search;
mod settings;
mod signs;
#[cfg(test)]
mod tests;
mod tree;

use nalgebra::{Point3, Vector3};

use patch::{Edge, Patch};
use search::Search;
pub use settings::DistanceSettings;
use signs::Signs;
use tree::Tree;

use crate::block::{Block, SIDE};
use crate::key::Key;
use crate::slots::Slots;
use crate::tiers::Copies;
use crate::{Error, Map};

/// Stands for blocks that no edge reaches into.
static NOWHERE: Block = Block::ZERO;

/// What [`DistanceField::update`] did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DistanceReport {
    /// Blocks that have changed since the last call.
    pub changed: usize,
    /// Blocks that are no longer in the map.
    pub removed: usize,
    /// Blocks whose sites were found again: those and their lower neighbours along x, y and z.
    pub rebuilt: usize,
}

/// The distance from the nearest known surface, for planners: far beyond the truncation distance, and without sign.
///
/// The surface is sampled by *sites*: one on every edge between two neighbouring voxels (of six) that were both observed
/// and lie on different sides, where the distance interpolated between them is zero. Every vertex of the map's mesh is a
/// site. A query is exact: it returns the distance to the nearest of all sites, found by branch and bound in a tree of
/// blocks; an update finds the sites of changed blocks again and touches nothing else. Sites are one voxel `h` apart at
/// most on a flat surface, so at a true distance `d` from it the answer is too large by `√(d² + h²/2) − d` at most: `0.71 h`
/// on the surface, `h/2` at a quarter of a voxel, `h/13` at three voxels.
///
/// It is that of the whole map: blocks that leave active memory keep their sites. Queries share the field, so that
/// several threads may ask at once.
///
/// ```
/// # use nalgebra::{Isometry3, Point3, Vector3};
/// # use tsdf_hash::{DepthData, DepthView, DistanceField, DistanceSettings, Intrinsics, Map, Settings};
/// # let depth = vec![1000_u16; 160 * 120];
/// # let intrinsics = Intrinsics { fx: 130.0, fy: 130.0, cx: 79.5, cy: 59.5 };
/// # let view = DepthView { width: 160, height: 120, data: DepthData::U16 { data: &depth, scale: 1000.0 }, intrinsics };
/// let mut map = Map::new(Settings::default())?;
/// let mut field = DistanceField::new(&DistanceSettings { radius: 0.8 })?;
/// map.integrate(&view, None, &Isometry3::identity())?; // a wall at z = 1
/// field.update(&map)?;
/// let (distance, gradient) = field.distance_and_gradient(&Point3::new(0.0, 0.0, 0.5)).ok_or("nothing near")?;
/// assert!((distance - 0.5).abs() < 1e-3 && (gradient + Vector3::z()).norm() < 0.02);
/// assert_eq!(field.distance(&Point3::origin()), None); // farther than 0.8 m
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct DistanceField {
    settings: DistanceSettings,
    /// One for each block of the map.
    patches: Slots<Patch>,
    /// The blocks with sites.
    tree: Tree,
    seen: Option<Moment>,
    voxel_size: f64,
    /// Patches to be made again; they stay here when reading a block fails.
    dirty: Vec<Key>,
    changed: Vec<Key>,
    /// To add up copies in: a block and those above it.
    sums: Vec<Block>,
    edges: Vec<Edge>,
}

/// The state of the map at the last update.
#[derive(Clone, Copy, PartialEq)]
struct Moment {
    map: u64,
    stamp: u64,
    removed: u64,
}

impl DistanceField {
    /// A field that has seen no map.
    ///
    /// # Errors
    /// [`Error::InvalidSetting`].
    pub fn new(settings: &DistanceSettings) -> Result<Self, Error> {
        settings.check()?;
        Ok(Self {
            settings: *settings,
            patches: Slots::new(),
            tree: Tree::new(f64::INFINITY),
            seen: None,
            voxel_size: 1.0,
            dirty: Vec::new(),
            changed: Vec::new(),
            sums: vec![Block::ZERO; 4],
            edges: Vec::new(),
        })
    }

    /// Its settings.
    pub fn settings(&self) -> &DistanceSettings {
        &self.settings
    }

    /// Follows the map, at the cost of what has changed. Another map than last time starts anew. The result depends on the
    /// map as it is, not on how often the field was updated.
    ///
    /// # Errors
    /// [`Error::Io`] and [`Error::Damaged`] when a block that is not in active memory cannot be read. The field is then
    /// up to date in part, and the next call goes on.
    pub fn update(&mut self, map: &Map) -> Result<DistanceReport, Error> {
        let copies = &map.copies;
        let now = Moment { map: copies.active.id(), stamp: copies.active.clock(), removed: copies.removed };
        let since = self.seen.filter(|seen| seen.map == now.map);
        if since.is_none() {
            self.patches = Slots::new();
            self.tree = Tree::new(2.0 * self.settings.radius / map.settings().block_size());
            self.voxel_size = map.settings().voxel_size;
            self.dirty.clear();
        }
        let mut report = DistanceReport::default();
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
        report.rebuilt = self.rebuild(copies)?;
        self.seen = Some(now);
        Ok(report)
    }

    /// Distance from the nearest site, metres, positive on both sides of a surface; `None` where none is closer than
    /// [`DistanceSettings::radius`]: the map does not tell free space from unseen space there.
    pub fn distance(&self, point_in_world: &Point3<f64>) -> Option<f64> {
        self.nearest(point_in_world).map(|offset| offset.norm())
    }

    /// [`distance`](Self::distance) and its gradient in the world: the unit vector away from the nearest site, zero at the
    /// site itself. Of several that are equally near it takes one, always the same.
    pub fn distance_and_gradient(&self, point_in_world: &Point3<f64>) -> Option<(f64, Vector3<f64>)> {
        let offset = self.nearest(point_in_world)?;
        Some((offset.norm(), offset.try_normalize(0.0).unwrap_or_default()))
    }

    /// All sites in the world, metres, block by block in the order of the block coordinates.
    pub fn sites(&self) -> impl Iterator<Item = Point3<f64>> + '_ {
        let mut order: Vec<usize> = (0..self.patches.len()).collect();
        order.sort_unstable_by_key(|&slot| self.patches.keys()[slot]);
        order.into_iter().flat_map(move |slot| {
            let corner = self.patches.keys()[slot].block().map(|c| f64::from(c) * SIDE as f64 + 0.5);
            self.patches.values()[slot]
                .sites
                .iter()
                .map(move |site| Point3::from([0, 1, 2].map(|k| (corner[k] + f64::from(site[k])) * self.voxel_size)))
        })
    }

    /// From the nearest site to the point, metres.
    fn nearest(&self, point_in_world: &Point3<f64>) -> Option<Vector3<f64>> {
        let point = point_in_world.coords.map(|c| c / self.voxel_size - 0.5);
        if !point.iter().all(|c| c.is_finite()) {
            return None;
        }
        let search = Search::run(self, point.into(), self.settings.radius / self.voxel_size);
        search.offset.map(|offset| Vector3::from(offset) * self.voxel_size)
    }

    /// Forgets blocks that are gone from all tiers.
    fn drop_removed(&mut self, copies: &Copies) -> usize {
        let gone: Vec<Key> = self.patches.keys().iter().copied().filter(|&key| !copies.contains(key)).collect();
        for &key in &gone {
            self.patches.remove(key);
            self.tree.set(key, false);
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

    /// Marks the patches with edges into a block.
    fn mark(&mut self, key: Key) {
        for step in [[0, 0, 0], [-1, 0, 0], [0, -1, 0], [0, 0, -1]] {
            let Some(key) = key.neighbour(step) else { continue };
            if let Some(patch) = self.patches.get_mut(key)
                && !patch.dirty
            {
                patch.dirty = true;
                self.dirty.push(key);
            }
        }
    }

    /// Makes the marked patches, the last first: then the signs of what lies above a block are known.
    fn rebuild(&mut self, copies: &Copies) -> Result<usize, Error> {
        self.dirty.sort_unstable();
        let mut rebuilt = 0;
        while let Some(&key) = self.dirty.last() {
            rebuilt += usize::from(self.rebuild_patch(key, copies)?);
            self.dirty.pop();
        }
        Ok(rebuilt)
    }

    fn rebuild_patch(&mut self, key: Key, copies: &Copies) -> Result<bool, Error> {
        // The block may have been removed since.
        let Some(patch) = self.patches.get_mut(key) else { return Ok(false) };
        if patch.unread {
            patch.signs = copies.sum(key, &mut self.sums[0])?.map_or(Signs::NONE, Signs::of);
            patch.unread = false;
        }
        let signs = patch.signs;
        let upper = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map(|step| key.neighbour(step));
        let above = upper.map(|key| self.patches.get(key?).map(|patch| patch.signs)).map(Option::unwrap_or_default);
        let touched = Edge::list(&signs, &above, &mut self.edges);
        let mut blocks = [&NOWHERE; 4];
        let keys = [Some(key), upper[0], upper[1], upper[2]];
        for (n, (block, sum)) in blocks.iter_mut().zip(&mut self.sums).enumerate() {
            if let Some(key) = keys[n].filter(|_| touched >> n & 1 == 1)
                && let Some(found) = copies.sum(key, sum)?
            {
                *block = found;
            }
        }
        let Some(patch) = self.patches.get_mut(key) else { return Ok(false) };
        patch.fill(self.edges.iter().map(|edge| edge.site(&blocks)));
        self.tree.set(key, !self.edges.is_empty());
        Ok(true)
    }
}
