//! The map: fuse, take out, look, mesh, ask, store.

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::{Isometry3, Point3, Vector3};

use crate::blocks::trilinear::TrilinearCell;
use crate::blocks::voxel_block::VoxelBlock;
use crate::error::Error;
use crate::file::contents::Contents;
use crate::file::writer;
use crate::frame_clock::FrameClock;
use crate::images::{ColourView, DepthView, Intrinsics};
use crate::integration::integrator::{Frame, Operation};
use crate::integration::plane_image::PlaneImage;
use crate::mesh::block_mesh::MeshScale;
use crate::mesh::incremental::IncrementalMesher;
use crate::mesh::triangle_mesh::Mesh;
use crate::ray_cast::camera::Camera;
use crate::ray_cast::caster;
use crate::ray_cast::settings::RayCastSettings;
use crate::ray_cast::single_ray::{self, SurfaceHit};
use crate::ray_cast::unpacked::in_view;
use crate::ray_cast::view::View;
use crate::report::{FrameReport, MemoryUsage};
use crate::settings::{MemoryLimits, Settings};
use crate::storage::block_storage::{BlockStorage, Transfers};
use crate::storage::frame_update::{FrameJob, PassedOver, apply_frame};
use crate::storage::merge_policy::{MergeDecision, MergePolicy};
use crate::storage::reloaded::ReloadedBlocks;
use crate::storage::swap_file::SwapFile;
use crate::trace::{event, span};

/// A truncated signed distance field in hashed blocks of 8³ voxels.
///
/// The voxel `(i, j, k)` has its centre at `(i + ½, j + ½, k + ½) h` in the world; the block of a point is
/// `floor(point / 8h)`. Distances are positive on the side of the camera.
pub struct Map {
    pub(crate) settings: Settings,
    pub(crate) storage: BlockStorage,
    plane_image: PlaneImage,
    pub(crate) clock: FrameClock,
}

impl Map {
    /// An empty map.
    ///
    /// # Errors
    /// [`Error::InvalidSetting`], and [`Error::SwapFileMismatch`] when there is to be a swap file.
    pub fn new(settings: Settings) -> Result<Self, Error> {
        settings.check()?;
        if settings.memory.disk_bytes > 0 {
            return Err(Error::SwapFileMismatch { disk_bytes: settings.memory.disk_bytes });
        }
        Self::with_storage(settings, None)
    }

    /// An empty map with the swap file `swap`, which is created, or emptied, and removed with the map.
    ///
    /// # Errors
    /// [`Error::InvalidSetting`], [`Error::SwapFileMismatch`] without [`MemoryLimits::disk_bytes`], [`Error::Io`].
    pub fn with_swap(settings: Settings, swap: &Path) -> Result<Self, Error> {
        settings.check()?;
        if settings.memory.disk_bytes == 0 {
            return Err(Error::SwapFileMismatch { disk_bytes: 0 });
        }
        let swap = SwapFile::create(swap, settings.memory.disk_bytes);
        Self::with_storage(settings, Some(swap.map_err(|source| Error::Io { what: "creating the swap file", source })?))
    }

    fn with_storage(settings: Settings, swap: Option<SwapFile>) -> Result<Self, Error> {
        let storage = BlockStorage::new(settings.max_bytes, settings.memory, swap)?;
        Ok(Self { settings, storage, plane_image: PlaneImage::default(), clock: FrameClock::default() })
    }

    /// Opens a file written by [`save`](Self::save) with the settings it was saved with; [`MapFile`](crate::storage::MapFile) does it
    /// with others.
    ///
    /// # Errors
    /// As [`MapFile::open`](crate::storage::MapFile::open) and [`MapFile::into_map`](crate::storage::MapFile::into_map).
    pub fn open(path: &Path) -> Result<Self, Error> {
        let contents = Contents::read(path)?;
        let settings = contents.settings;
        Self::from_contents(contents, settings, None)
    }

    /// What [`MapFile::into_map`](crate::storage::MapFile::into_map) does.
    pub(crate) fn from_contents(contents: Contents, settings: Settings, swap: Option<&Path>) -> Result<Self, Error> {
        let Settings { max_bytes, threads, memory, .. } = settings;
        if settings != (Settings { max_bytes, threads, memory, ..contents.settings }) {
            return Err(Error::IncompatibleSettings);
        }
        let mut map = match swap {
            Some(swap) => Self::with_swap(settings, swap)?,
            None => Self::new(settings)?,
        };
        map.clock = contents.clock;
        let (file, blocks) = contents.into_blocks();
        map.storage.open(file, &blocks)?;
        Ok(map)
    }

    /// Writes the whole map, evicted blocks included, to a file; with a mesh, if there is one, and with any metadata.
    ///
    /// It is written beside and moved to its place when it is complete and on disk: after a crash there is the old file or
    /// the new one.
    ///
    /// # Errors
    /// [`Error::Io`], and [`Error::CorruptBlock`] when a block cannot be read.
    pub fn save(&self, path: &Path, mesh: Option<&Mesh>, metadata: &BTreeMap<String, Vec<u8>>) -> Result<(), Error> {
        writer::save(path, &self.settings, self.clock, &self.storage, mesh, metadata)
    }

    /// The settings given to [`new`](Self::new).
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Fuses a depth image, and a colour image taken from the same place, seen from `world_from_camera`.
    ///
    /// Without a time, a thirtieth of a second passes with every frame; none, once a frame has come with its time.
    ///
    /// # Errors
    /// Views, intrinsics or pose that make no sense, [`Error::NoDepth`], [`Error::OutOfRange`], [`Error::OutOfBudget`],
    /// [`Error::Saturated`], and where blocks can be evicted [`Error::StorageFull`], [`Error::Io`], [`Error::CorruptBlock`].
    /// The map is then as it was.
    pub fn integrate(
        &mut self,
        depth: &DepthView,
        colour: Option<&ColourView>,
        world_from_camera: &Isometry3<f64>,
    ) -> Result<FrameReport, Error> {
        self.integrate_then(self.clock.next(), depth, colour, world_from_camera, &mut PassedOver::default())
    }

    /// [`integrate`](Self::integrate), but blocks whose voxels have no room for another observation take nothing: a camera that looks at one
    /// place for long does not keep the map from what else it sees. They are put into `full`, in place of what was there, for
    /// [`deintegrate_except`](Self::deintegrate_except).
    ///
    /// # Errors
    /// As [`integrate`](Self::integrate), but never [`Error::Saturated`].
    pub fn integrate_where_room(
        &mut self,
        depth: &DepthView,
        colour: Option<&ColourView>,
        world_from_camera: &Isometry3<f64>,
        full: &mut Vec<[i32; 3]>,
    ) -> Result<FrameReport, Error> {
        let mut passed_over = PassedOver::growing();
        let report = self.integrate_then(self.clock.next(), depth, colour, world_from_camera, &mut passed_over)?;
        passed_over.write(full);
        Ok(report)
    }

    /// [`integrate`](Self::integrate) of a frame that was taken at `time`, seconds: what decides which blocks are old.
    ///
    /// # Errors
    /// As [`integrate`](Self::integrate), and [`Error::InvalidTime`] unless `time` is finite and later than that of the
    /// frame before.
    pub fn integrate_at(
        &mut self,
        time: f64,
        depth: &DepthView,
        colour: Option<&ColourView>,
        world_from_camera: &Isometry3<f64>,
    ) -> Result<FrameReport, Error> {
        self.integrate_then(self.clock.at(time)?, depth, colour, world_from_camera, &mut PassedOver::default())
    }

    fn integrate_then(
        &mut self,
        clock: FrameClock,
        depth: &DepthView,
        colour: Option<&ColourView>,
        world_from_camera: &Isometry3<f64>,
        passed_over: &mut PassedOver,
    ) -> Result<FrameReport, Error> {
        let views = (depth, colour, world_from_camera);
        let report = self.apply(Operation::Integrate, views, clock.time(), passed_over)?;
        self.clock = clock;
        Ok(report)
    }

    /// Takes out a frame that was fused with exactly these arguments: the map is then, to the bit, as if it had never
    /// been seen.
    ///
    /// # Errors
    /// As [`integrate`](Self::integrate), and [`Error::NotIntegrated`]. The map is then as it was. A frame that was never
    /// fused is detected where it would leave a count below zero or a sum out of range, which all but the smallest
    /// changes of pose or pixels do somewhere; keep the arguments rather than rely on it.
    pub fn deintegrate(
        &mut self,
        depth: &DepthView,
        colour: Option<&ColourView>,
        world_from_camera: &Isometry3<f64>,
    ) -> Result<FrameReport, Error> {
        self.deintegrate_except(depth, colour, world_from_camera, &[])
    }

    /// Takes out a frame that was fused by [`integrate_where_room`](Self::integrate_where_room), which said that these blocks were full.
    ///
    /// # Errors
    /// As [`deintegrate`](Self::deintegrate).
    pub fn deintegrate_except(
        &mut self,
        depth: &DepthView,
        colour: Option<&ColourView>,
        world_from_camera: &Isometry3<f64>,
        full: &[[i32; 3]],
    ) -> Result<FrameReport, Error> {
        let views = (depth, colour, world_from_camera);
        self.apply(Operation::Deintegrate, views, self.clock.time(), &mut PassedOver::new(full))
    }

    fn apply(
        &mut self,
        operation: Operation,
        (depth, colour, world_from_camera): (&DepthView, Option<&ColourView>, &Isometry3<f64>),
        time: f64,
        passed_over: &mut PassedOver,
    ) -> Result<FrameReport, Error> {
        span!("apply_frame");
        let frame = Frame::read(&mut self.plane_image, depth, colour, world_from_camera, &self.settings)?;
        let camera = world_from_camera.translation.vector / self.settings.block_size();
        let job = FrameJob { frame: &frame, operation, time, camera: camera.into(), threads: self.settings.threads };
        self.storage.begin_call();
        let storage = &mut self.storage;
        let change = passed_over.apply(&frame.plane_image.keys, |keys| apply_frame(storage, job, keys))?;
        let transfers = match operation {
            Operation::Integrate => self.storage.transfer(&change.touched, time),
            Operation::Deintegrate => Transfers::default(),
        };
        event!(
            debug,
            valid = self.plane_image.valid,
            fused = self.plane_image.fused,
            added = change.added,
            evicted = transfers.evicted,
            timed_out = transfers.timed_out,
            "frame applied"
        );
        Ok(FrameReport {
            valid_pixels: self.plane_image.valid,
            fused_pixels: self.plane_image.fused,
            filled_pixels: self.plane_image.filled,
            voxels: change.voxels,
            blocks: change.blocks,
            blocks_added: change.added,
            blocks_removed: change.removed,
            blocks_evicted: transfers.evicted,
            blocks_reloaded: transfers.reloaded,
            blocks_timed_out: transfers.timed_out,
        })
    }

    /// Bytes in active memory: what [`Settings::max_bytes`] caps. The working memory of a call (about 24 bytes per pixel)
    /// and the meshes handed out are not in it.
    pub fn bytes(&self) -> usize {
        self.storage.active_bytes()
    }

    /// Where the blocks are, and the bytes they take.
    pub fn memory(&self) -> MemoryUsage {
        let [host_blocks, disk_blocks, file_blocks] = self.storage.evicted.counts();
        MemoryUsage {
            active_bytes: self.bytes(),
            host_bytes: self.storage.evicted.host_bytes(),
            disk_bytes: self.storage.evicted.disk_bytes(),
            active_blocks: self.storage.active.len(),
            reloaded_blocks: self.storage.reloaded.len(),
            host_blocks,
            disk_blocks,
            file_blocks,
        }
    }

    /// Number of blocks, evicted ones included, of 7168 bytes each when active.
    pub fn blocks(&self) -> usize {
        self.storage.len()
    }

    /// A hash of all voxels, evicted ones included, in the order of the block coordinates: equal for equal maps, whatever
    /// the order of the frames, the number of threads, and the memory they were given.
    pub fn hash(&self) -> u64 {
        self.storage.hash()
    }

    /// The reloaded blocks that wait for a decision, to be looked at.
    pub fn reloaded_blocks(&self) -> ReloadedBlocks<'_> {
        ReloadedBlocks::new(&self.storage.reloaded, &self.storage.active, &self.settings)
    }

    /// Asks for a decision about the reloaded blocks, if there are any, and returns how many were merged.
    ///
    /// # Errors
    /// Those of the evicted memory, when a reloaded block has to make room. The map's sums are as they were.
    pub fn merge_reloaded(&mut self, policy: &mut dyn MergePolicy) -> Result<usize, Error> {
        let reloaded = self.reloaded_blocks();
        if reloaded.is_empty() {
            return Ok(0);
        }
        match policy.decide(&reloaded) {
            MergeDecision::Merge => self.storage.merge_reloaded(),
            MergeDecision::Defer => Ok(0),
        }
    }

    /// A copy of the whole map in active memory without a cap, to mesh or to query.
    ///
    /// # Errors
    /// [`Error::Io`] and [`Error::CorruptBlock`] when a block cannot be read.
    pub fn consolidated(&self) -> Result<Self, Error> {
        let settings = Settings { max_bytes: usize::MAX, memory: MemoryLimits::default(), ..self.settings };
        let mut whole = Self::new(settings)?;
        for key in self.storage.sorted_keys() {
            let mut sum = Box::new(VoxelBlock::ZERO);
            let history = self.storage.total(key, &mut sum)?;
            whole.storage.active.insert(key, sum, history);
        }
        Ok(whole)
    }

    /// The surface as a camera at `world_from_camera` sees it, by casting one ray per pixel through the active blocks.
    ///
    /// A hit is where the interpolated distance first falls through zero, within half a voxel of an observed
    /// voxel along each axis. A ray that meets the solid from an unobserved side ends there without a hit.
    ///
    /// # Errors
    /// Settings, size, intrinsics or pose that make no sense.
    pub fn ray_cast(
        &self,
        intrinsics: &Intrinsics,
        width: usize,
        height: usize,
        world_from_camera: &Isometry3<f64>,
        settings: &RayCastSettings,
    ) -> Result<View, Error> {
        let mut view = View::new();
        self.ray_cast_into(intrinsics, width, height, world_from_camera, settings, &mut view)?;
        Ok(view)
    }

    /// [`ray_cast`](Self::ray_cast) into a view that exists.
    ///
    /// # Errors
    /// As [`ray_cast`](Self::ray_cast); the view is then as it was.
    pub fn ray_cast_into(
        &self,
        intrinsics: &Intrinsics,
        width: usize,
        height: usize,
        world_from_camera: &Isometry3<f64>,
        settings: &RayCastSettings,
        view: &mut View,
    ) -> Result<(), Error> {
        let camera = Camera::new(intrinsics, (width, height), world_from_camera, &self.settings, settings)?;
        view.resize(intrinsics, (width, height), world_from_camera);
        caster::fill(&self.storage.active, &camera, settings, view);
        Ok(())
    }

    /// Brings evicted blocks that a camera at `world_from_camera` would see, or would if nothing stood before them, back into active
    /// memory, the nearest first, as far as there is room once blocks out of its view have left: before a place is
    /// [looked at](Self::ray_cast) that no frame has touched for long, as a lost camera must. [`MemoryLimits::max_transfers`] does not
    /// bound it. No sum changes. Returns how many.
    ///
    /// # Errors
    /// As [`ray_cast`](Self::ray_cast), and those of evicted blocks.
    pub fn reload_view(
        &mut self,
        intrinsics: &Intrinsics,
        width: usize,
        height: usize,
        world_from_camera: &Isometry3<f64>,
        settings: &RayCastSettings,
    ) -> Result<usize, Error> {
        if self.storage.evicted.is_empty() {
            return Ok(0);
        }
        let camera = Camera::new(intrinsics, (width, height), world_from_camera, &self.settings, settings)?;
        let wanted = in_view(self.storage.evicted.keys(), &camera);
        let in_use = in_view(self.storage.active.keys().iter().copied(), &camera);
        let from = world_from_camera.translation.vector / self.settings.block_size();
        self.storage.reload_all(&wanted, &in_use, from.into())
    }

    /// The zero level of the field by marching cubes, where all eight voxels of a cell have been observed and the distance
    /// does not jump; of the blocks in active memory. [`IncrementalMesher`] has that of all blocks, and follows a map that
    /// changes.
    ///
    /// Vertices and faces come in the order of the block coordinates, so equal maps give equal meshes. The sign test is
    /// "solid where the distance is below zero". Every edge has at most two faces.
    pub fn mesh(&self) -> Mesh {
        span!("mesh");
        IncrementalMesher::of_active(&self.storage.active, &MeshScale::new(&self.settings))
    }

    /// Signed distance from the nearest surface, metres, by trilinear interpolation in active memory; `None` where one of
    /// the eight voxels around the point was never observed (farther than `μ` from every surface, behind one, or unseen).
    pub fn distance(&self, point_in_world: &Point3<f64>) -> Option<f64> {
        self.cell_around(point_in_world).map(|cell| cell.distance())
    }

    /// [`distance`](Self::distance), and its gradient in the world: the exact one of the interpolation, of length about
    /// one near a surface, away from it. It jumps where the point passes from one cell of voxels to the next.
    pub fn distance_and_gradient(&self, point_in_world: &Point3<f64>) -> Option<(f64, Vector3<f64>)> {
        let cell = self.cell_around(point_in_world)?;
        Some((cell.distance(), cell.gradient() / self.settings.voxel_size))
    }

    /// Where a ray from `origin` along `direction`, of any length, first meets the surface in active memory within `max_distance` metres;
    /// `None` if it meets none there, or the solid from a side that was never seen. [`ray_cast`](Self::ray_cast) is for images.
    pub fn cast(&self, origin: &Point3<f64>, direction: &Vector3<f64>, max_distance: f64) -> Option<SurfaceHit> {
        single_ray::cast(&self.settings, |key| self.storage.active.get(key), origin, direction, max_distance)
    }

    fn cell_around(&self, point_in_world: &Point3<f64>) -> Option<TrilinearCell> {
        TrilinearCell::around(&self.settings, |key| self.storage.active.get(key), point_in_world)
    }
}
