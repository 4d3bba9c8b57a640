//! The map on a GPU: the same bytes as [`Map`] makes on the processor.
//!
//! The processor fits the planes of the depth image and selects the blocks near it; the device holds the blocks, counts what
//! a frame touches and updates them. Every operation of the update is done as IEEE 754 says, whatever the device's compiler
//! would like to do (`exact.wgsl`), and a device is asked whether it does before it is used (`probe.rs`).

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::Isometry3;

use crate::blocks::block_history::BlockHistory;
use crate::blocks::block_key::BlockKey;
use crate::blocks::block_table::BlockTable;
use crate::blocks::voxel_block::VoxelBlock;
use crate::changes::{BlockChanges, MapVersion};
use crate::dense_map::DenseMap;
use crate::error::Error;
use crate::file::writer;
use crate::frame_clock::FrameClock;
use crate::gpu::cast::Caster;
use crate::gpu::device::Device;
use crate::gpu::fuse::{Fuser, Mode, Pass, UpdateCount};
use crate::gpu::options::GpuOptions;
use crate::gpu::probe;
use crate::gpu::split::{Split, mode, touched};
use crate::gpu::tiers::{Elsewhere, Tiers};
use crate::images::{ColourView, DepthView, Intrinsics};
use crate::integration::integrator::{Frame, Operation};
use crate::integration::plane_image::PlaneImage;
use crate::layer::{BlockReader, TsdfLayer};
use crate::map::Map;
use crate::mesh::triangle_mesh::Mesh;
use crate::ray_cast::camera::Camera;
use crate::ray_cast::settings::RayCastSettings;
use crate::ray_cast::view::View;
use crate::report::{FrameReport, MemoryUsage};
use crate::settings::{MemoryLimits, Settings};
use crate::storage::block_storage::BlockStorage;
use crate::storage::frame_update::{FrameJob, PassedOver, Refusal};

/// A map whose blocks lie on a GPU. It equals, to the bit, a [`Map`] that was given the same frames.
///
/// [`Settings::max_bytes`] caps the blocks on the device and their index on the processor; buffers for one frame (16 bytes
/// per pixel, the colour image) and for blocks on their way (3.5 MiB) come on top. Behind the device stands a [`Map`] on the processor with
/// the [`MemoryLimits`](crate::storage::MemoryLimits) of the settings, whose own active memory is 1 MiB to work with: as a map on the
/// processor evicts blocks from its active memory and reloads them, so does this one from the device's (thesis Paper I, section 4.3). What
/// of a frame meets blocks that are evicted, or finds no room on the device, is fused on the processor.
///
/// Open and close maps of a process one after another: NVIDIA's Vulkan driver 580 now and then hangs or crashes where several threads do so
/// side by side.
pub struct GpuMap {
    tiers: Tiers,
    fuser: Fuser,
    caster: Caster,
    plane_image: PlaneImage,
}

impl GpuMap {
    /// An empty map.
    ///
    /// # Errors
    /// As [`Map::new`] and [`from_map`](Self::from_map).
    pub fn new(settings: Settings, options: &GpuOptions) -> Result<Self, Error> {
        Self::from_map(Map::new(settings)?, options).map_err(|refused| refused.1)
    }

    /// A map that goes on from `map`, with its settings, its swap file, and its evicted blocks, which stay where they are.
    ///
    /// # Errors
    /// With the map: [`Error::NoAdapter`] where there is no GPU; [`Error::Device`] if it does not compute as IEEE 754 says or refuses its
    /// buffers; [`Error::InvalidSetting`] with a [`merge_timeout`](crate::storage::MemoryLimits::merge_timeout), because a block has one
    /// copy here; [`Error::OutOfBudget`] if the device has no room for the active blocks and none can be evicted.
    pub fn from_map(map: Map, options: &GpuOptions) -> Result<Self, Box<(Map, Error)>> {
        let opened = match Self::open(map.settings(), options) {
            Ok(opened) => opened,
            Err(error) => return Err(Box::new((map, error))),
        };
        let (device, fuser, caster) = opened;
        Ok(Self { tiers: Tiers::new(map, device)?, fuser, caster, plane_image: PlaneImage::default() })
    }

    fn open(settings: &Settings, options: &GpuOptions) -> Result<(Device, Fuser, Caster), Error> {
        let value = settings.memory.merge_timeout;
        if value > 0.0 {
            let requirement = "0 on a GPU, where what is reloaded is merged at once: use a map on the processor";
            return Err(Error::InvalidSetting { name: "memory.merge_timeout", value, requirement });
        }
        let device = Device::open(options)?;
        probe::check(&device)?;
        let (fuser, caster) = (Fuser::new(&device)?, Caster::new(&device)?);
        Ok((device, fuser, caster))
    }

    /// The settings given to [`new`](Self::new).
    pub fn settings(&self) -> &Settings {
        self.tiers.host.settings()
    }

    /// Name, interface and driver of the device.
    pub fn adapter(&self) -> &str {
        &self.tiers.device.name
    }

    /// Where the blocks are, and the bytes they take: active ones are those on the device.
    pub fn memory(&self) -> MemoryUsage {
        let (active_bytes, active_blocks) = (self.tiers.pool.bytes(), self.tiers.pool.len());
        MemoryUsage { active_bytes, active_blocks, ..self.tiers.host.memory() }
    }

    /// Writes the whole map to a file, as [`Map::save`]; blocks of the device pass through the staging buffer.
    ///
    /// # Errors
    /// As [`Map::save`], and [`Error::Device`].
    pub fn save(&self, path: &Path, mesh: Option<&Mesh>, metadata: &BTreeMap<String, Vec<u8>>) -> Result<(), Error> {
        writer::save(path, self.settings(), self.tiers.host.clock, &self.tiers, mesh, metadata)
    }

    /// A copy in active memory of at most `max_bytes`, to mesh, to query or to store.
    ///
    /// # Errors
    /// [`Error::InvalidSetting`], [`Error::OutOfBudget`], [`Error::Device`], and those of evicted blocks.
    pub fn to_map(&self, max_bytes: usize) -> Result<Map, Error> {
        self.tiers.copy(Settings { max_bytes, memory: MemoryLimits::default(), ..*self.settings() })
    }

    /// The map on the processor, evicted blocks where they are. Where its active memory has no room for what was on the device, and nothing
    /// can be evicted, it has no cap.
    ///
    /// # Errors
    /// [`Error::Device`], and those of evicted blocks.
    pub fn into_map(self) -> Result<Map, Error> {
        self.tiers.into_map()
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
        self.tiers.host.clock = clock;
        Ok(report)
    }

    fn apply(
        &mut self,
        operation: Operation,
        (depth, colour, world_from_camera): (&DepthView, Option<&ColourView>, &Isometry3<f64>),
        time: f64,
        passed_over: &mut PassedOver,
    ) -> Result<FrameReport, Error> {
        let Self { tiers, fuser, plane_image, .. } = self;
        let settings = *tiers.host.settings();
        let frame = Frame::read(plane_image, depth, colour, world_from_camera, &settings)?;
        let camera = world_from_camera.translation.vector / settings.block_size();
        let job = FrameJob { frame: &frame, operation, time, camera: camera.into(), threads: settings.threads };
        tiers.host.storage.begin_call();
        fuser.load(&tiers.device, &frame)?;
        let Applied { needed, changed, elsewhere } =
            passed_over.apply(&frame.plane_image.keys, |keys| try_to_apply(tiers, fuser, job, keys))?;
        let history = tiers.host.storage.new_history(time);
        let added = Split::added(&mut tiers.pool, &elsewhere.fresh, history);
        let passes: Vec<Pass> = added.update(Mode::Integrate).collect();
        let done = fuser.submit(&tiers.device, &tiers.pool, &frame, &passes);
        done.map_err(|error| tiers.device.lose(error))?;
        let removed = elsewhere.removed + tiers.count(job, &changed);
        let [blocks_reloaded, blocks_evicted] = match operation {
            Operation::Integrate => tiers.transfer(&elsewhere.on_host, job),
            Operation::Deintegrate => [0, 0],
        };
        Ok(FrameReport {
            valid_pixels: frame.plane_image.valid,
            fused_pixels: frame.plane_image.fused,
            filled_pixels: frame.plane_image.filled,
            voxels: needed.iter().chain(&changed).map(|work| work.1.voxels()).sum(),
            blocks: needed.len() + changed.len(),
            blocks_added: elsewhere.added,
            blocks_removed: removed,
            blocks_evicted,
            blocks_reloaded,
            blocks_timed_out: 0,
        })
    }
}

/// A frame in the blocks on the device, and what it needs besides.
struct Applied {
    needed: Vec<(BlockKey, UpdateCount)>,
    changed: Vec<(BlockKey, UpdateCount)>,
    elsewhere: Elsewhere,
}

fn try_to_apply(tiers: &mut Tiers, fuser: &mut Fuser, job: FrameJob, keys: &[BlockKey]) -> Result<Applied, Refusal> {
    let split = Split::new(&tiers.pool, keys);
    // One submission counts in the blocks that are not here and changes those that are: waiting costs more than undoing.
    let (absent, present) = (split.count(), split.update(mode(job.operation)));
    let passes: Vec<Pass> = std::iter::once(absent).chain(present).collect();
    let counts = fuser.run(&tiers.device, &tiers.pool, job.frame, &passes)?;
    let (counted, updated) = counts.split_at(split.absent.len());
    let needed = touched(split.absent.iter(), counted);
    let changed = touched(split.present.iter().flatten(), updated);
    match tiers.admit(job, &changed, &needed) {
        Ok(elsewhere) => Ok(Applied { needed, changed, elsewhere }),
        Err(refusal) => {
            // Wrapping sums form a group: the opposite update restores every bit. What was evicted to make room was not touched.
            let passes: Vec<Pass> = split.update(mode(job.operation.opposite())).collect();
            let undone = fuser.submit(&tiers.device, &tiers.pool, job.frame, &passes);
            undone.map_err(|error| tiers.device.lose(error))?;
            Err(refusal)
        }
    }
}

/// Blocks that were fetched from the device, and those that are not there.
struct FetchedBlocks<'a> {
    fetched: BlockTable<Box<VoxelBlock>>,
    host: &'a BlockStorage,
}

impl BlockReader for FetchedBlocks<'_> {
    fn block<'a>(&'a self, block: [i32; 3], scratch: &'a mut VoxelBlock) -> Result<Option<&'a VoxelBlock>, Error> {
        let Some(key) = BlockKey::new(block) else { return Ok(None) };
        self.fetched.get(key).map_or_else(|| self.host.sum(key, scratch), |block| Ok(Some(block)))
    }
}

impl TsdfLayer for GpuMap {
    fn settings(&self) -> &Settings {
        GpuMap::settings(self)
    }

    fn changes_since(&self, before: Option<MapVersion>) -> BlockChanges {
        let Tiers { pool, host, .. } = &self.tiers;
        BlockChanges::new(host.storage.active.clock.version(), before, |stamp| {
            let later = |&(_, history): &(BlockKey, BlockHistory)| stamp.is_none_or(|stamp| history.stamp > stamp);
            let here = pool.histories().filter(later).map(|(key, _)| key);
            here.chain(host.storage.changed_since(stamp)).map(BlockKey::block).collect()
        })
    }

    fn contains_block(&self, block: [i32; 3]) -> bool {
        let Tiers { pool, host, .. } = &self.tiers;
        BlockKey::new(block).is_some_and(|key| pool.get(key).is_some() || host.storage.contains(key))
    }

    fn read_blocks<'a>(
        &'a self,
        wanted: &mut dyn Iterator<Item = [i32; 3]>,
    ) -> Result<Box<dyn BlockReader + 'a>, Error> {
        let mut keys: Vec<BlockKey> = wanted.filter_map(BlockKey::new).collect();
        keys.sort_unstable();
        keys.dedup();
        let mut fetched = BlockTable::new();
        self.tiers.download(&keys, |key, block| {
            fetched.insert(key, Box::new(block.clone()));
            Ok(())
        })?;
        Ok(Box::new(FetchedBlocks { fetched, host: &self.tiers.host.storage }))
    }
}

/// Each as the method of [`Map`] says; active memory is that of the device. After an [`Error::Device`] the map is as it was, unless the
/// device is lost, which every later call reports too.
impl DenseMap for GpuMap {
    fn integrate(
        &mut self,
        depth: &DepthView,
        colour: Option<&ColourView>,
        world_from_camera: &Isometry3<f64>,
    ) -> Result<FrameReport, Error> {
        self.integrate_then(self.tiers.host.clock.next(), depth, colour, world_from_camera, &mut PassedOver::default())
    }

    fn integrate_at(
        &mut self,
        time: f64,
        depth: &DepthView,
        colour: Option<&ColourView>,
        world_from_camera: &Isometry3<f64>,
    ) -> Result<FrameReport, Error> {
        self.integrate_then(
            self.tiers.host.clock.at(time)?,
            depth,
            colour,
            world_from_camera,
            &mut PassedOver::default(),
        )
    }

    fn deintegrate(
        &mut self,
        depth: &DepthView,
        colour: Option<&ColourView>,
        world_from_camera: &Isometry3<f64>,
    ) -> Result<FrameReport, Error> {
        self.deintegrate_except(depth, colour, world_from_camera, &[])
    }

    fn integrate_where_room(
        &mut self,
        depth: &DepthView,
        colour: Option<&ColourView>,
        world_from_camera: &Isometry3<f64>,
        full: &mut Vec<[i32; 3]>,
    ) -> Result<FrameReport, Error> {
        let mut passed_over = PassedOver::growing();
        let clock = self.tiers.host.clock.next();
        let report = self.integrate_then(clock, depth, colour, world_from_camera, &mut passed_over)?;
        passed_over.write(full);
        Ok(report)
    }

    fn deintegrate_except(
        &mut self,
        depth: &DepthView,
        colour: Option<&ColourView>,
        world_from_camera: &Isometry3<f64>,
        full: &[[i32; 3]],
    ) -> Result<FrameReport, Error> {
        let views = (depth, colour, world_from_camera);
        let time = self.tiers.host.clock.time();
        self.apply(Operation::Deintegrate, views, time, &mut PassedOver::new(full))
    }

    fn ray_cast(
        &mut self,
        intrinsics: &Intrinsics,
        width: usize,
        height: usize,
        world_from_camera: &Isometry3<f64>,
        settings: &RayCastSettings,
    ) -> Result<View, Error> {
        let camera = Camera::new(intrinsics, (width, height), world_from_camera, GpuMap::settings(self), settings)?;
        let mut view = View::new();
        view.resize(intrinsics, (width, height), world_from_camera);
        self.caster.fill(&self.tiers.device, &self.tiers.pool, &camera, settings.colour, &mut view)?;
        Ok(view)
    }

    fn reload_view(
        &mut self,
        intrinsics: &Intrinsics,
        width: usize,
        height: usize,
        world_from_camera: &Isometry3<f64>,
        settings: &RayCastSettings,
    ) -> Result<usize, Error> {
        let camera = Camera::new(intrinsics, (width, height), world_from_camera, GpuMap::settings(self), settings)?;
        let from = world_from_camera.translation.vector / GpuMap::settings(self).block_size();
        self.tiers.reload_view(&camera, from.into())
    }

    fn bytes(&self) -> usize {
        self.tiers.pool.bytes()
    }

    fn blocks(&self) -> usize {
        self.tiers.pool.len() + self.tiers.host.blocks()
    }

    fn hash(&self) -> Result<u64, Error> {
        self.tiers.hash()
    }
}
