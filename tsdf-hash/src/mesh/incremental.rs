//! The mesh of a growing map, made again only where the map has changed.

use std::convert::Infallible;

use crate::blocks::active_blocks::ActiveBlocks;
use crate::blocks::block_key::BlockKey;
use crate::blocks::sign_bits::SignBits;
use crate::blocks::voxel_block::VoxelBlock;
use crate::derived_blocks::{DerivedBlocks, UpdateReport};
use crate::error::Error;
use crate::layer::{BlockReader, TsdfLayer};
use crate::mesh::block_mesh::{BlockMesh, BlockMesher, MeshScale};
use crate::mesh::marching_cubes::CASES;
use crate::mesh::patches::{ChangedPatches, PatchKey, patch, patches_of};
use crate::mesh::triangle_mesh::Mesh;
use crate::mesh::weld::weld;

/// Stands for blocks that no cell reaches into.
static EMPTY_BLOCK: VoxelBlock = VoxelBlock::ZERO;
/// The cells of a block reach into the seven blocks above it.
const SOURCES: [[i32; 3]; 8] = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1], [1, 1, 1]];

/// The mesh of a map, kept up to date at the cost of what has changed (thesis Paper I, section 4.6).
///
/// It is that of the whole map: evicted blocks keep their piece of the surface, and blocks with several copies are meshed by
/// their sum. So [`mesh`](Self::mesh) equals `map.consolidated()?.mesh()` after every update, to the bit and in the same
/// order. It follows any [`TsdfLayer`]: a [`Map`](crate::Map), a map on a GPU, or the caller's own. A mesher that is shown
/// another map starts anew.
///
/// ```
/// # use nalgebra::Isometry3;
/// # use tsdf_hash::mesh::IncrementalMesher;
/// # use tsdf_hash::{DepthData, DepthView, Intrinsics, Map, Settings};
/// # let depth = vec![1000_u16; 160 * 120];
/// # let intrinsics = Intrinsics { fx: 130.0, fy: 130.0, cx: 79.5, cy: 59.5 };
/// # let view = DepthView { width: 160, height: 120, data: DepthData::U16 { data: &depth, scale: 1000.0 }, intrinsics };
/// let (mut map, mut mesher) = (Map::new(Settings::default())?, IncrementalMesher::new());
/// for step in 0..3 {
///     map.integrate(&view, None, &Isometry3::translation(0.1 * f64::from(step), 0.0, 0.0))?;
///     let report = mesher.update(&map)?;
///     assert!(report.changed > 0);
/// }
/// assert_eq!(mesher.mesh(), map.mesh());
/// assert_eq!(mesher.update(&map)?.rebuilt, 0);
/// # Ok::<(), tsdf_hash::Error>(())
/// ```
pub struct IncrementalMesher {
    meshes: DerivedBlocks<BlockMesh>,
    changed: ChangedPatches,
    mesher: BlockMesher,
    /// To add up copies in: a block and those above it.
    sums: Vec<VoxelBlock>,
}

impl Default for IncrementalMesher {
    fn default() -> Self {
        Self {
            meshes: DerivedBlocks::new(&SOURCES),
            changed: ChangedPatches::default(),
            mesher: BlockMesher::new(),
            sums: vec![VoxelBlock::ZERO; 8],
        }
    }
}

impl IncrementalMesher {
    /// A mesher that has seen no map.
    pub fn new() -> Self {
        Self::default()
    }

    /// Follows the map.
    ///
    /// # Errors
    /// Those of the layer, such as [`Error::Io`] and [`Error::CorruptBlock`] when an evicted block cannot be read. The mesh
    /// is then up to date in part, and the next call goes on.
    pub fn update<L: TsdfLayer + ?Sized>(&mut self, map: &L) -> Result<UpdateReport, Error> {
        let followed = self.meshes.follow(map);
        followed.left_behind.iter().chain(&followed.removed).for_each(|key| self.changed.add(*key));
        let scale = MeshScale::new(map.settings());
        self.meshes.sort_dirty();
        let mut rebuilt = 0;
        while let Some(left) = self.meshes.next_batch() {
            let reader = map.read_blocks(&mut self.meshes.wanted(left))?;
            rebuilt += self.rebuild(left, &*reader, &scale)?;
        }
        self.meshes.commit(followed.version);
        Ok(UpdateReport { changed: followed.changed, removed: followed.removed.len(), rebuilt })
    }

    /// The mesh, welded: one vertex per cut voxel edge, in the order of [`Map::mesh`](crate::Map::mesh).
    pub fn mesh(&self) -> Mesh {
        weld(&self.meshes.blocks)
    }

    /// The patches that the updates since the last call have changed, in their order; those of which nothing is left included.
    pub fn take_changed_patches(&mut self) -> Vec<PatchKey> {
        self.changed.take()
    }

    /// All patches of the map, in their order.
    pub fn patches(&self) -> Vec<PatchKey> {
        patches_of(self.meshes.blocks.keys().iter())
    }

    /// The mesh of a patch; empty where there is no surface. It is not welded: blocks have vertices of their own where they meet.
    pub fn patch(&self, key: PatchKey) -> Mesh {
        patch(&self.meshes.blocks, key)
    }

    /// The mesh of a layer as it is.
    ///
    /// # Errors
    /// As [`update`](Self::update).
    pub fn mesh_of<L: TsdfLayer + ?Sized>(map: &L) -> Result<Mesh, Error> {
        let mut mesher = Self::new();
        mesher.update(map)?;
        Ok(mesher.mesh())
    }

    /// The mesh of the blocks in active memory.
    pub(crate) fn of_active(active: &ActiveBlocks, scale: &MeshScale) -> Mesh {
        let mut mesher = Self::new();
        mesher.meshes.mark_changed(active.keys().iter().copied());
        mesher.meshes.sort_dirty();
        match mesher.rebuild(0, active, scale) {
            Ok(_) => mesher.mesh(),
            Err(never) => match never {},
        }
    }

    /// Makes the meshes of the dirty blocks until so many are left, the last block first: much of what it reads is then
    /// still in the cache.
    fn rebuild<S: Source + ?Sized>(&mut self, left: usize, source: &S, scale: &MeshScale) -> Result<usize, S::Error> {
        let mut rebuilt = 0;
        while let Some(key) = self.meshes.next_dirty(left) {
            self.changed.add(key);
            rebuilt += usize::from(self.rebuild_block(key, source, scale)?);
            self.meshes.done();
        }
        Ok(rebuilt)
    }

    fn rebuild_block<S: Source + ?Sized>(
        &mut self,
        key: BlockKey,
        source: &S,
        scale: &MeshScale,
    ) -> Result<bool, S::Error> {
        let meshes = &mut self.meshes.blocks;
        // The block may have been removed since.
        let Some(derived) = meshes.get_mut(key) else { return Ok(false) };
        if derived.unread {
            if let Some(block) = source.block(key, &mut self.sums[0])? {
                derived.signs = SignBits::of(block);
            }
            derived.unread = false;
        }
        let upper = SOURCES.map(|step| key.neighbour(step));
        let signs = upper.map(|key| meshes.get(key?).map(|derived| derived.signs));
        let needed = self.mesher.find(&signs);
        let mut blocks = [&EMPTY_BLOCK; 8];
        for (n, (block, sum)) in blocks.iter_mut().zip(&mut self.sums).enumerate() {
            if let Some(key) = upper[n].filter(|_| needed >> n & 1 == 1)
                && let Some(found) = source.block(key, sum)?
            {
                *block = found;
            }
        }
        let Some(derived) = meshes.get_mut(key) else { return Ok(false) };
        if needed == 0 {
            derived.data.clear();
        } else {
            self.mesher.make(&mut derived.data, key, &blocks, &CASES, scale);
        }
        Ok(true)
    }
}

/// Where blocks are read from: active memory never fails.
trait Source {
    type Error;

    /// A block; `sum` is there to add up copies.
    fn block<'a>(&'a self, key: BlockKey, sum: &'a mut VoxelBlock) -> Result<Option<&'a VoxelBlock>, Self::Error>;
}

impl Source for ActiveBlocks {
    type Error = Infallible;

    fn block<'a>(&'a self, key: BlockKey, _: &'a mut VoxelBlock) -> Result<Option<&'a VoxelBlock>, Infallible> {
        Ok(self.get(key))
    }
}

impl Source for dyn BlockReader + '_ {
    type Error = Error;

    fn block<'a>(&'a self, key: BlockKey, sum: &'a mut VoxelBlock) -> Result<Option<&'a VoxelBlock>, Error> {
        BlockReader::block(self, key.block(), sum)
    }
}
