//! The map on a GPU: the same bytes as [`Map`] makes on the processor.
//!
//! The processor fits the planes of the depth image and selects the blocks near it; the device holds the blocks, counts what
//! a frame touches and updates them. Every operation of the update is done as IEEE 754 says, whatever the device's compiler
//! would like to do (`exact.wgsl`), and a device is asked whether it does before it is used (`probe.rs`).

use nalgebra::Isometry3;

use crate::blocks::block_key::BlockKey;
use crate::blocks::block_table::BlockTable;
use crate::blocks::voxel_block::VoxelBlock;
use crate::changes::{BlockChanges, MapVersion};
use crate::dense_map::DenseMap;
use crate::error::Error;
use crate::frame_clock::FrameClock;
use crate::gpu::cast::Caster;
use crate::gpu::device::Device;
use crate::gpu::fuse::{Fuser, Mode, Pass};
use crate::gpu::options::GpuOptions;
use crate::gpu::pool::Pool;
use crate::gpu::probe;
use crate::gpu::split::{Split, admit, mode, touched};
use crate::gpu::stream::{Stream, upload};
use crate::images::{ColourView, DepthView, Intrinsics};
use crate::integration::integrator::{Frame, Operation};
use crate::integration::plane_image::PlaneImage;
use crate::layer::{BlockReader, TsdfLayer};
use crate::map::Map;
use crate::ray_cast::camera::Camera;
use crate::ray_cast::settings::RayCastSettings;
use crate::ray_cast::view::View;
use crate::report::FrameReport;
use crate::settings::{MemoryLimits, Settings};
use crate::storage::block_storage::hash_block;

/// A map whose blocks lie on a GPU. It equals, to the bit, a [`Map`] that was given the same frames.
///
/// [`Settings::max_bytes`] caps the blocks on the device and their index on the processor; buffers for one frame (16 bytes
/// per pixel, the colour image) and for blocks on their way (3.5 MiB) come on top. [`Settings::memory`] plays no part: see
/// [`drain_into`](Self::drain_into).
///
/// Open and close maps of a process one after another: NVIDIA's Vulkan driver 580 now and then hangs or crashes where several threads do so
/// side by side.
pub struct GpuMap {
    settings: Settings,
    device: Device,
    pool: Pool,
    fuser: Fuser,
    caster: Caster,
    stream: Stream,
    plane_image: PlaneImage,
    clock: FrameClock,
}

impl GpuMap {
    /// An empty map.
    ///
    /// # Errors
    /// [`Error::InvalidSetting`]; [`Error::NoAdapter`] where there is no GPU; [`Error::Device`] if it does not compute as
    /// IEEE 754 says or refuses its buffers.
    pub fn new(settings: Settings, options: &GpuOptions) -> Result<Self, Error> {
        settings.check()?;
        let device = Device::open(options)?;
        probe::check(&device)?;
        let pool = Pool::new(&device, settings.max_bytes)?;
        let (fuser, caster, stream) = (Fuser::new(&device)?, Caster::new(&device)?, Stream::new(&device)?);
        Ok(Self {
            settings,
            device,
            pool,
            fuser,
            caster,
            stream,
            plane_image: PlaneImage::default(),
            clock: FrameClock::default(),
        })
    }

    /// The settings given to [`new`](Self::new).
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Name, interface and driver of the device.
    pub fn adapter(&self) -> &str {
        &self.device.name
    }

    /// A map that goes on from `map`, evicted blocks included, with its settings.
    ///
    /// # Errors
    /// As [`new`](Self::new), [`Error::OutOfBudget`], and those of the map's evicted blocks.
    pub fn from_map(map: &Map, options: &GpuOptions) -> Result<Self, Error> {
        let mut gpu = Self::new(*map.settings(), options)?;
        let keys = map.storage.sorted_keys();
        if keys.len() > gpu.pool.room() {
            return Err(gpu.pool.out_of_budget());
        }
        gpu.pool.reserve(&gpu.device, keys.len())?;
        let mut sum = Box::new(VoxelBlock::ZERO);
        for key in keys {
            map.storage.total(key, &mut sum)?;
            upload(&gpu.device, &mut gpu.pool, key, &sum)?;
        }
        Ok(gpu)
    }

    /// A copy in active memory of at most `max_bytes`, to mesh, to query or to store.
    ///
    /// # Errors
    /// [`Error::InvalidSetting`], [`Error::OutOfBudget`], [`Error::Device`].
    pub fn to_map(&self, max_bytes: usize) -> Result<Map, Error> {
        let mut map = Map::new(Settings { max_bytes, memory: MemoryLimits::default(), ..self.settings })?;
        let keys = self.pool.sorted_keys();
        self.stream.download(&self.device, &self.pool, &keys, |key, block| map.storage.add_block(key, block))?;
        Ok(map)
    }

    /// Moves all blocks into `map`, where they are added to its own, and leaves none on the device. So a map that outgrows
    /// the device goes on: the sums of both are the sums of all frames at any time. Frames that were moved are taken out of
    /// `map`.
    ///
    /// # Errors
    /// [`Error::InvalidSetting`] if the maps differ in more than memory and threads, [`Error::Saturated`],
    /// [`Error::OutOfBudget`], those of its evicted memory, [`Error::Device`]. What has not been moved is then still here.
    pub fn drain_into(&mut self, map: &mut Map) -> Result<(), Error> {
        let Settings { max_bytes, threads, memory, .. } = self.settings;
        if (Settings { max_bytes, threads, memory, ..*map.settings() }) != self.settings {
            let requirement = "that of the map on the device, and so must be all settings but memory and threads";
            return Err(Error::InvalidSetting { name: "voxel_size", value: map.settings().voxel_size, requirement });
        }
        let mut moved = Vec::new();
        let keys = self.pool.sorted_keys();
        let outcome = self.stream.download(&self.device, &self.pool, &keys, |key, block| {
            map.storage.add_block(key, block)?;
            moved.push(key);
            Ok(())
        });
        for key in moved {
            self.pool.remove(key);
        }
        outcome
    }

    fn integrate_then(
        &mut self,
        clock: FrameClock,
        depth: &DepthView,
        colour: Option<&ColourView>,
        world_from_camera: &Isometry3<f64>,
    ) -> Result<FrameReport, Error> {
        let report = self.apply(Operation::Integrate, depth, colour, world_from_camera)?;
        self.clock = clock;
        Ok(report)
    }

    fn apply(
        &mut self,
        operation: Operation,
        depth: &DepthView,
        colour: Option<&ColourView>,
        world_from_camera: &Isometry3<f64>,
    ) -> Result<FrameReport, Error> {
        let frame = Frame::read(&mut self.plane_image, depth, colour, world_from_camera, &self.settings)?;
        let split = Split::new(&self.pool, &frame.plane_image.keys);
        self.fuser.load(&self.device, &frame)?;
        // One submission counts in the blocks that do not exist and changes those that do: waiting costs more than undoing.
        let (absent, present) = (split.count(), split.update(mode(operation)));
        let passes: Vec<Pass> = std::iter::once(absent).chain(present).collect();
        let counts = self.fuser.run(&self.device, &self.pool, &frame, &passes)?;
        let (counted, updated) = counts.split_at(split.absent.len());
        let needed = touched(split.absent.iter(), counted);
        let changed = touched(split.present.iter().flatten(), updated);
        if let Err(refusal) = admit(&mut self.pool, &self.device, operation, &needed, &changed) {
            // Wrapping sums form a group: the opposite update restores every bit.
            let passes: Vec<Pass> = split.update(mode(operation.opposite())).collect();
            let undone = self.fuser.submit(&self.device, &self.pool, &frame, &passes);
            undone.map_err(|error| self.device.lose(error))?;
            return Err(refusal);
        }
        let added = Split::added(&mut self.pool, &needed);
        let passes: Vec<Pass> = added.update(Mode::Integrate).collect();
        let done = self.fuser.submit(&self.device, &self.pool, &frame, &passes);
        done.map_err(|error| self.device.lose(error))?;
        for work in &changed {
            self.pool.mark_changed(work.0);
        }
        let emptied: Vec<BlockKey> = changed.iter().filter(|work| !work.1.observed()).map(|work| work.0).collect();
        for &key in &emptied {
            self.pool.remove(key);
        }
        Ok(FrameReport {
            valid_pixels: frame.plane_image.valid,
            fused_pixels: frame.plane_image.fused,
            filled_pixels: frame.plane_image.filled,
            voxels: needed.iter().chain(&changed).map(|work| work.1.voxels()).sum(),
            blocks: needed.len() + changed.len(),
            blocks_added: needed.len(),
            blocks_removed: emptied.len(),
            blocks_evicted: 0,
            blocks_reloaded: 0,
            blocks_timed_out: 0,
        })
    }
}

/// Blocks that were fetched from the device.
struct FetchedBlocks(BlockTable<Box<VoxelBlock>>);

impl BlockReader for FetchedBlocks {
    fn block<'a>(&'a self, block: [i32; 3], _: &'a mut VoxelBlock) -> Result<Option<&'a VoxelBlock>, Error> {
        Ok(BlockKey::new(block).and_then(|key| self.0.get(key)).map(|block| &**block))
    }
}

impl TsdfLayer for GpuMap {
    fn settings(&self) -> &Settings {
        &self.settings
    }

    fn changes_since(&self, before: Option<MapVersion>) -> BlockChanges {
        BlockChanges::new(self.pool.clock.version(), before, |stamp| {
            self.pool.changed_since(stamp.unwrap_or(0)).map(BlockKey::block).collect()
        })
    }

    fn contains_block(&self, block: [i32; 3]) -> bool {
        BlockKey::new(block).is_some_and(|key| self.pool.get(key).is_some())
    }

    fn read_blocks<'a>(
        &'a self,
        wanted: &mut dyn Iterator<Item = [i32; 3]>,
    ) -> Result<Box<dyn BlockReader + 'a>, Error> {
        let mut keys: Vec<BlockKey> = wanted.filter_map(BlockKey::new).collect();
        keys.sort_unstable();
        keys.dedup();
        let mut fetched = BlockTable::new();
        self.stream.download(&self.device, &self.pool, &keys, |key, block| {
            fetched.insert(key, Box::new(block.clone()));
            Ok(())
        })?;
        Ok(Box::new(FetchedBlocks(fetched)))
    }
}

/// Each as the method of [`Map`] says, of blocks on the device. After an [`Error::Device`] the map is as it was, unless the
/// device is lost, which every later call reports too.
impl DenseMap for GpuMap {
    fn integrate(
        &mut self,
        depth: &DepthView,
        colour: Option<&ColourView>,
        world_from_camera: &Isometry3<f64>,
    ) -> Result<FrameReport, Error> {
        self.integrate_then(self.clock.next(), depth, colour, world_from_camera)
    }

    fn integrate_at(
        &mut self,
        time: f64,
        depth: &DepthView,
        colour: Option<&ColourView>,
        world_from_camera: &Isometry3<f64>,
    ) -> Result<FrameReport, Error> {
        self.integrate_then(self.clock.at(time)?, depth, colour, world_from_camera)
    }

    fn deintegrate(
        &mut self,
        depth: &DepthView,
        colour: Option<&ColourView>,
        world_from_camera: &Isometry3<f64>,
    ) -> Result<FrameReport, Error> {
        self.apply(Operation::Deintegrate, depth, colour, world_from_camera)
    }

    fn ray_cast(
        &mut self,
        intrinsics: &Intrinsics,
        width: usize,
        height: usize,
        world_from_camera: &Isometry3<f64>,
        settings: &RayCastSettings,
    ) -> Result<View, Error> {
        let camera = Camera::new(intrinsics, (width, height), world_from_camera, &self.settings, settings)?;
        let mut view = View::new();
        view.resize(intrinsics, (width, height), world_from_camera);
        self.caster.fill(&self.device, &self.pool, &camera, settings.colour, &mut view)?;
        Ok(view)
    }

    fn bytes(&self) -> usize {
        self.pool.bytes()
    }

    fn blocks(&self) -> usize {
        self.pool.len()
    }

    fn hash(&self) -> Result<u64, Error> {
        let mut hash = 0;
        self.stream.download(&self.device, &self.pool, &self.pool.sorted_keys(), |key, block| {
            hash = hash_block(hash, key, block.fingerprint());
            Ok(())
        })?;
        Ok(hash)
    }
}
