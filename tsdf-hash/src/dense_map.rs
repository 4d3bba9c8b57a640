//! The seam at which one map is swapped for another.

use nalgebra::{Isometry3, Point3, Vector3};

use crate::blocks::block_key::BlockKey;
use crate::blocks::voxel_block::VoxelBlock;
use crate::changes::{BlockChanges, MapVersion};
use crate::error::Error;
use crate::images::{ColourView, DepthView, Intrinsics};
use crate::layer::{BlockReader, TsdfLayer, cell_around};
use crate::map::Map;
use crate::mesh::incremental::IncrementalMesher;
use crate::mesh::triangle_mesh::Mesh;
use crate::ray_cast::settings::RayCastSettings;
use crate::ray_cast::view::View;
use crate::report::FrameReport;
use crate::settings::Settings;
use crate::storage::block_storage::BlockStorage;

/// A dense map, whoever keeps it: on the processor ([`Map`]), on a GPU, or the caller's own.
///
/// It is a [`TsdfLayer`], too, so that distances can be asked for and an [`IncrementalMesher`] or a
/// [`DistanceField`](crate::distance_field::DistanceField) can follow it. Maps of this crate that were given the same frames have the same
/// hash, whatever keeps them.
///
/// ```
/// use nalgebra::Isometry3;
/// use tsdf_hash::{DenseMap, DepthView, Error, Map, Settings};
///
/// fn correct(map: &mut dyn DenseMap, view: &DepthView, old: &Isometry3<f64>, new: &Isometry3<f64>) -> Result<(), Error> {
///     map.deintegrate(view, None, old)?;
///     map.integrate(view, None, new)?;
///     Ok(())
/// }
///
/// let maps: Vec<Box<dyn DenseMap>> = vec![Box::new(Map::new(Settings::default())?)];
/// assert_eq!((maps[0].blocks(), maps[0].mesh()?.faces.len()), (0, 0));
/// # Ok::<(), Error>(())
/// ```
pub trait DenseMap: TsdfLayer {
    /// Fuses a frame of unknown time; all or nothing, as [`Map::integrate`].
    ///
    /// # Errors
    /// As [`Map::integrate`].
    fn integrate(
        &mut self,
        depth: &DepthView,
        colour: Option<&ColourView>,
        world_from_camera: &Isometry3<f64>,
    ) -> Result<FrameReport, Error>;

    /// Fuses a frame that was taken at `time`, seconds, as [`Map::integrate_at`].
    ///
    /// # Errors
    /// As [`Map::integrate_at`].
    fn integrate_at(
        &mut self,
        time: f64,
        depth: &DepthView,
        colour: Option<&ColourView>,
        world_from_camera: &Isometry3<f64>,
    ) -> Result<FrameReport, Error>;

    /// Takes a frame out; all or nothing, as [`Map::deintegrate`].
    ///
    /// # Errors
    /// As [`Map::deintegrate`].
    fn deintegrate(
        &mut self,
        depth: &DepthView,
        colour: Option<&ColourView>,
        world_from_camera: &Isometry3<f64>,
    ) -> Result<FrameReport, Error>;

    /// Fuses a frame of unknown time in blocks that have room for it, as [`Map::integrate_where_room`]; a map that has no such limit has
    /// none that are full.
    ///
    /// # Errors
    /// As [`Map::integrate_where_room`].
    fn integrate_where_room(
        &mut self,
        depth: &DepthView,
        colour: Option<&ColourView>,
        world_from_camera: &Isometry3<f64>,
        full: &mut Vec<[i32; 3]>,
    ) -> Result<FrameReport, Error> {
        full.clear();
        self.integrate(depth, colour, world_from_camera)
    }

    /// Takes out a frame that found these blocks full, as [`Map::deintegrate_except`].
    ///
    /// # Errors
    /// As [`Map::deintegrate_except`].
    fn deintegrate_except(
        &mut self,
        depth: &DepthView,
        colour: Option<&ColourView>,
        world_from_camera: &Isometry3<f64>,
        _full: &[[i32; 3]],
    ) -> Result<FrameReport, Error> {
        self.deintegrate(depth, colour, world_from_camera)
    }

    /// What a camera sees of the surface that is in active memory, as [`Map::ray_cast`].
    ///
    /// # Errors
    /// As [`Map::ray_cast`].
    fn ray_cast(
        &mut self,
        intrinsics: &Intrinsics,
        width: usize,
        height: usize,
        world_from_camera: &Isometry3<f64>,
        settings: &RayCastSettings,
    ) -> Result<View, Error>;

    /// Brings evicted blocks that a camera would see back into active memory, as [`Map::reload_view`]; none unless a map evicts any.
    ///
    /// # Errors
    /// As [`Map::reload_view`].
    fn reload_view(
        &mut self,
        _intrinsics: &Intrinsics,
        _width: usize,
        _height: usize,
        _world_from_camera: &Isometry3<f64>,
        _settings: &RayCastSettings,
    ) -> Result<usize, Error> {
        Ok(0)
    }

    /// The surface of the whole map, evicted blocks included.
    ///
    /// # Errors
    /// When a block cannot be read.
    fn mesh(&self) -> Result<Mesh, Error> {
        IncrementalMesher::mesh_of(self)
    }

    /// A hash of all voxels, as [`Map::hash`].
    ///
    /// # Errors
    /// When a block cannot be read.
    fn hash(&self) -> Result<u64, Error>;

    /// Number of blocks.
    fn blocks(&self) -> usize;

    /// Bytes of the memory that [`Settings::max_bytes`] caps.
    fn bytes(&self) -> usize;
}

impl TsdfLayer for Map {
    fn settings(&self) -> &Settings {
        Map::settings(self)
    }

    fn changes_since(&self, before: Option<MapVersion>) -> BlockChanges {
        let storage = &self.storage;
        let since = |stamp| storage.changed_since(stamp).into_iter().map(BlockKey::block).collect();
        BlockChanges::new(storage.active.clock.version(), before, since)
    }

    fn contains_block(&self, block: [i32; 3]) -> bool {
        BlockKey::new(block).is_some_and(|key| self.storage.contains(key))
    }

    fn read_blocks<'a>(&'a self, _: &mut dyn Iterator<Item = [i32; 3]>) -> Result<Box<dyn BlockReader + 'a>, Error> {
        Ok(Box::new(&self.storage))
    }

    fn distance(&self, point_in_world: &Point3<f64>) -> Result<Option<f64>, Error> {
        if self.storage.all_active() {
            return Ok(Map::distance(self, point_in_world));
        }
        Ok(cell_around(self, point_in_world)?.map(|cell| cell.distance()))
    }

    fn distance_and_gradient(&self, point_in_world: &Point3<f64>) -> Result<Option<(f64, Vector3<f64>)>, Error> {
        if self.storage.all_active() {
            return Ok(Map::distance_and_gradient(self, point_in_world));
        }
        let cell = cell_around(self, point_in_world)?;
        Ok(cell.map(|cell| (cell.distance(), cell.gradient() / self.settings.voxel_size)))
    }
}

impl BlockReader for &BlockStorage {
    fn block<'a>(&'a self, block: [i32; 3], scratch: &'a mut VoxelBlock) -> Result<Option<&'a VoxelBlock>, Error> {
        BlockKey::new(block).map_or(Ok(None), |key| self.sum(key, scratch))
    }
}

impl DenseMap for Map {
    fn integrate(
        &mut self,
        depth: &DepthView,
        colour: Option<&ColourView>,
        world_from_camera: &Isometry3<f64>,
    ) -> Result<FrameReport, Error> {
        Map::integrate(self, depth, colour, world_from_camera)
    }

    fn integrate_at(
        &mut self,
        time: f64,
        depth: &DepthView,
        colour: Option<&ColourView>,
        world_from_camera: &Isometry3<f64>,
    ) -> Result<FrameReport, Error> {
        Map::integrate_at(self, time, depth, colour, world_from_camera)
    }

    fn deintegrate(
        &mut self,
        depth: &DepthView,
        colour: Option<&ColourView>,
        world_from_camera: &Isometry3<f64>,
    ) -> Result<FrameReport, Error> {
        Map::deintegrate(self, depth, colour, world_from_camera)
    }

    fn integrate_where_room(
        &mut self,
        depth: &DepthView,
        colour: Option<&ColourView>,
        world_from_camera: &Isometry3<f64>,
        full: &mut Vec<[i32; 3]>,
    ) -> Result<FrameReport, Error> {
        Map::integrate_where_room(self, depth, colour, world_from_camera, full)
    }

    fn deintegrate_except(
        &mut self,
        depth: &DepthView,
        colour: Option<&ColourView>,
        world_from_camera: &Isometry3<f64>,
        full: &[[i32; 3]],
    ) -> Result<FrameReport, Error> {
        Map::deintegrate_except(self, depth, colour, world_from_camera, full)
    }

    fn ray_cast(
        &mut self,
        intrinsics: &Intrinsics,
        width: usize,
        height: usize,
        world_from_camera: &Isometry3<f64>,
        settings: &RayCastSettings,
    ) -> Result<View, Error> {
        Map::ray_cast(self, intrinsics, width, height, world_from_camera, settings)
    }

    fn reload_view(
        &mut self,
        intrinsics: &Intrinsics,
        width: usize,
        height: usize,
        world_from_camera: &Isometry3<f64>,
        settings: &RayCastSettings,
    ) -> Result<usize, Error> {
        Map::reload_view(self, intrinsics, width, height, world_from_camera, settings)
    }

    fn mesh(&self) -> Result<Mesh, Error> {
        if self.storage.all_active() { Ok(Map::mesh(self)) } else { IncrementalMesher::mesh_of(self) }
    }

    fn hash(&self) -> Result<u64, Error> {
        Ok(Map::hash(self))
    }

    fn blocks(&self) -> usize {
        Map::blocks(self)
    }

    fn bytes(&self) -> usize {
        Map::bytes(self)
    }
}
