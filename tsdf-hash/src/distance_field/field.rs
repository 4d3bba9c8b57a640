//! An exact Euclidean distance field that follows the map: distances far beyond the truncation distance.

use nalgebra::{Point3, Vector3};

use crate::blocks::block_key::BlockKey;
use crate::blocks::sign_bits::SignBits;
use crate::blocks::voxel_block::{SIDE, VoxelBlock};
use crate::derived_blocks::{DerivedBlocks, UpdateReport};
use crate::distance_field::search::Search;
use crate::distance_field::settings::DistanceSettings;
use crate::distance_field::sites::{BlockSites, CutEdge};
use crate::distance_field::tree::Tree;
use crate::error::Error;
use crate::layer::{BlockReader, TsdfLayer};

/// Stands for blocks that no edge reaches into.
static EMPTY_BLOCK: VoxelBlock = VoxelBlock::ZERO;
/// The edges of a block reach into the three blocks above it.
const SOURCES: [[i32; 3]; 4] = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]];

/// The distance from the nearest known surface, for planners: far beyond the truncation distance, and without sign.
///
/// The surface is sampled by *sites*: one on every edge between two neighbouring voxels (of six) that were both observed
/// and lie on different sides, where the distance interpolated between them is zero. Every vertex of the map's mesh is a
/// site. A query is exact: it returns the distance to the nearest of all sites, found by branch and bound in a tree of
/// blocks; an update finds the sites of changed blocks again and touches nothing else. Sites are one voxel `h` apart at
/// most on a flat surface, so at a true distance `d` from it the answer is too large by `√(d² + h²/2) − d` at most: `0.71 h`
/// on the surface, `h/2` at a quarter of a voxel, `h/13` at three voxels.
///
/// It is that of the whole map: evicted blocks keep their sites. It follows any [`TsdfLayer`]. Queries share the field, so that
/// several threads may ask at once.
///
/// ```
/// # use nalgebra::{Isometry3, Point3, Vector3};
/// # use tsdf_hash::distance_field::{DistanceField, DistanceSettings};
/// # use tsdf_hash::{DepthData, DepthView, Intrinsics, Map, Settings};
/// # let depth = vec![1000_u16; 160 * 120];
/// # let intrinsics = Intrinsics { fx: 130.0, fy: 130.0, cx: 79.5, cy: 59.5 };
/// # let view = DepthView { width: 160, height: 120, data: DepthData::U16 { data: &depth, scale: 1000.0 }, intrinsics };
/// let mut map = Map::new(Settings::default())?;
/// let mut field = DistanceField::new(&DistanceSettings { max_distance: 0.8 })?;
/// map.integrate(&view, None, &Isometry3::identity())?; // a wall at z = 1
/// field.update(&map)?;
/// let (distance, gradient) = field.distance_and_gradient(&Point3::new(0.0, 0.0, 0.5)).ok_or("nothing near")?;
/// assert!((distance - 0.5).abs() < 1e-3 && (gradient + Vector3::z()).norm() < 0.02);
/// assert_eq!(field.distance(&Point3::origin()), None); // farther than 0.8 m
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct DistanceField {
    settings: DistanceSettings,
    sites: DerivedBlocks<BlockSites>,
    /// The blocks with sites.
    tree: Tree,
    voxel_size: f64,
    /// To add up copies in: a block and those above it.
    sums: Vec<VoxelBlock>,
    edges: Vec<CutEdge>,
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
            sites: DerivedBlocks::new(&SOURCES),
            tree: Tree::new(f64::INFINITY),
            voxel_size: 1.0,
            sums: vec![VoxelBlock::ZERO; 4],
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
    /// Those of the layer, such as [`Error::Io`] and [`Error::CorruptBlock`] when an evicted block cannot be read. The field
    /// is then up to date in part, and the next call goes on.
    pub fn update<L: TsdfLayer + ?Sized>(&mut self, map: &L) -> Result<UpdateReport, Error> {
        let followed = self.sites.follow(map);
        if followed.is_new_map {
            self.tree = Tree::new(2.0 * self.settings.max_distance / map.settings().block_size());
            self.voxel_size = map.settings().voxel_size;
        }
        followed.removed.iter().for_each(|&key| self.tree.set(key, false));
        self.sites.sort_dirty();
        let mut rebuilt = 0;
        while let Some(left) = self.sites.next_batch() {
            let reader = map.read_blocks(&mut self.sites.wanted(left))?;
            // The last first: then the signs of what lies above a block are known.
            while let Some(key) = self.sites.next_dirty(left) {
                rebuilt += usize::from(self.rebuild_block(key, &*reader)?);
                self.sites.done();
            }
        }
        self.sites.commit(followed.version);
        Ok(UpdateReport { changed: followed.changed, removed: followed.removed.len(), rebuilt })
    }

    /// Distance from the nearest site, metres, positive on both sides of a surface; `None` where none is closer than
    /// [`DistanceSettings::max_distance`]: the map does not tell free space from unseen space there.
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
        let mut order: Vec<usize> = (0..self.sites.blocks.len()).collect();
        order.sort_unstable_by_key(|&slot| self.sites.blocks.keys()[slot]);
        order.into_iter().flat_map(move |slot| {
            let corner = self.sites.blocks.keys()[slot].block().map(|c| f64::from(c) * SIDE as f64 + 0.5);
            self.sites.blocks.values()[slot]
                .data
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
        let search =
            Search::run(&self.sites.blocks, &self.tree, point.into(), self.settings.max_distance / self.voxel_size);
        search.offset.map(|offset| Vector3::from(offset) * self.voxel_size)
    }

    fn rebuild_block(&mut self, key: BlockKey, reader: &dyn BlockReader) -> Result<bool, Error> {
        let sites = &mut self.sites.blocks;
        // The block may have been removed since.
        let Some(derived) = sites.get_mut(key) else { return Ok(false) };
        if derived.unread {
            derived.signs = reader.block(key.block(), &mut self.sums[0])?.map_or(SignBits::NONE, SignBits::of);
            derived.unread = false;
        }
        let signs = derived.signs;
        let keys = SOURCES.map(|step| key.neighbour(step));
        let above = [keys[1], keys[2], keys[3]].map(|key| sites.get(key?).map(|derived| derived.signs));
        let touched = CutEdge::list(&signs, &above.map(Option::unwrap_or_default), &mut self.edges);
        let mut blocks = [&EMPTY_BLOCK; 4];
        for (n, (block, sum)) in blocks.iter_mut().zip(&mut self.sums).enumerate() {
            if let Some(key) = keys[n].filter(|_| touched >> n & 1 == 1)
                && let Some(found) = reader.block(key.block(), sum)?
            {
                *block = found;
            }
        }
        let Some(derived) = sites.get_mut(key) else { return Ok(false) };
        derived.data.fill(self.edges.iter().map(|edge| edge.site(&blocks)));
        self.tree.set(key, !self.edges.is_empty());
        Ok(true)
    }
}
