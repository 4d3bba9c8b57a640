//! The map on a GPU: the same bytes as [`Map`] makes on the processor.
//!
//! The processor reads the depth image and finds the blocks near it; the device holds the blocks, counts what a frame
//! touches and updates them. Every operation of the update is done as IEEE 754 says, whatever the device's compiler would
//! like to do (`exact.wgsl`), and a device is asked whether it does before it is used (`probe.rs`).

mod cast;
mod device;
mod fuse;
mod pool;
mod probe;
mod scratch;
mod split;
mod stream;

use nalgebra::Isometry3;

use crate::block::Block;
use crate::cast::camera::Camera;
use crate::fuse::{Frame, Sign};
use crate::key::Key;
use crate::surface::Surface;
use crate::tiers::fold;
use crate::view::{ColourView, DepthView, Intrinsics, check_pose, check_sides};
use crate::{CastSettings, DenseMap, Error, FrameReport, Map, Mesh, Settings, Tiers, View};
use cast::Caster;
use device::Device;
use fuse::{Fuser, Mode, Pass};
use pool::Pool;
use scratch::{Scratch, spread};
use split::{Split, admit, mode, touched};
use stream::Stream;

/// Which adapter to use, and how.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct GpuOptions {
    /// Part of the adapter's name; empty for the best one (discrete before integrated).
    pub adapter: String,
    /// Whether an adapter may be a program on the processor, such as Mesa's lavapipe: slower than [`Map`], and
    /// meant for tests.
    pub software: bool,
    /// The largest single buffer, bytes; the adapter's own limit holds in any case (ours: none).
    pub max_buffer_bytes: usize,
}

impl Default for GpuOptions {
    fn default() -> Self {
        Self { adapter: String::new(), software: false, max_buffer_bytes: usize::MAX }
    }
}

/// A map whose blocks lie on a GPU. It equals, to the bit, a [`Map`] that was given the same frames.
///
/// [`Settings::max_bytes`] caps the blocks on the device and their index on the processor; buffers for one frame (16 bytes
/// per pixel, the colour image) and for blocks on their way (3.5 MiB) come on top. [`Settings::tiers`] plays no part: see
/// [`pour_into`](Self::pour_into).
pub struct GpuMap {
    settings: Settings,
    device: Device,
    pool: Pool,
    fuser: Fuser,
    caster: Caster,
    stream: Stream,
    surface: Surface,
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
        Ok(Self { settings, device, pool, fuser, caster, stream, surface: Surface::default() })
    }

    /// The settings given to [`new`](Self::new).
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Name, interface and driver of the device.
    pub fn adapter(&self) -> &str {
        &self.device.name
    }

    /// A map that goes on from `map`, all its tiers, with its settings.
    ///
    /// # Errors
    /// As [`new`](Self::new), [`Error::OutOfBudget`], and those of the map's tiers.
    pub fn from_map(map: &Map, options: &GpuOptions) -> Result<Self, Error> {
        let mut gpu = Self::new(*map.settings(), options)?;
        let keys = map.copies.sorted_keys();
        if keys.len() > gpu.pool.room() {
            return Err(gpu.pool.out_of_budget());
        }
        gpu.pool.reserve(&gpu.device, keys.len())?;
        let mut sum = Box::new(Block::ZERO);
        for key in keys {
            map.copies.total(key, &mut sum)?;
            stream::upload(&gpu.device, &mut gpu.pool, key, &sum)?;
        }
        Ok(gpu)
    }

    /// A copy in active memory of at most `max_bytes`, to mesh, to query or to store.
    ///
    /// # Errors
    /// [`Error::InvalidSetting`], [`Error::OutOfBudget`], [`Error::Device`].
    pub fn to_map(&self, max_bytes: usize) -> Result<Map, Error> {
        let mut map = Map::new(Settings { max_bytes, tiers: Tiers::default(), ..self.settings })?;
        let keys = self.pool.sorted_keys();
        self.stream.download(&self.device, &self.pool, &keys, |key, block| map.copies.absorb(key, block, [0.0; 3]))?;
        Ok(map)
    }

    /// Moves all blocks into `map`, where they are added to its own, and leaves none on the device. So a map that outgrows
    /// the device goes on: the sums of both are the sums of all frames at any time. Frames that were moved are taken out of
    /// `map`.
    ///
    /// # Errors
    /// [`Error::InvalidSetting`] if the maps differ in more than memory and threads, [`Error::Saturated`],
    /// [`Error::OutOfBudget`], those of the tiers, [`Error::Device`]. What has not been moved is then still here.
    pub fn pour_into(&mut self, map: &mut Map) -> Result<(), Error> {
        let Settings { max_bytes, threads, tiers, .. } = self.settings;
        if (Settings { max_bytes, threads, tiers, ..*map.settings() }) != self.settings {
            let requirement = "that of the map on the device, and so must be all settings but memory and threads";
            return Err(Error::InvalidSetting { name: "voxel_size", value: map.settings().voxel_size, requirement });
        }
        let mut moved = Vec::new();
        let keys = self.pool.sorted_keys();
        let outcome = self.stream.download(&self.device, &self.pool, &keys, |key, block| {
            map.copies.absorb(key, block, [0.0; 3])?;
            moved.push(key);
            Ok(())
        });
        for key in moved {
            self.pool.remove(key);
        }
        outcome
    }

    fn apply(
        &mut self,
        sign: Sign,
        depth: &DepthView,
        colour: Option<&ColourView>,
        world_from_camera: &Isometry3<f64>,
    ) -> Result<FrameReport, Error> {
        depth.check()?;
        if let Some(colour) = colour {
            colour.check()?;
        }
        check_pose(world_from_camera)?;
        self.surface.read(depth, world_from_camera, &self.settings)?;
        let frame = Frame::new(&self.surface, &depth.intrinsics, colour, world_from_camera, &self.settings);
        let split = Split::new(&self.pool, &self.surface.keys);
        self.fuser.load(&self.device, &frame)?;
        // One submission counts in the blocks that do not exist and changes those that do: waiting costs more than undoing.
        let (absent, present) = (split.count(), split.update(mode(sign)));
        let passes: Vec<Pass> = std::iter::once(absent).chain(present).collect();
        let tallies = self.fuser.run(&self.device, &self.pool, &frame, &passes)?;
        let (counted, updated) = tallies.split_at(split.absent.len());
        let needed = touched(split.absent.iter(), counted);
        let changed = touched(split.present.iter().flatten(), updated);
        if let Err(refusal) = admit(&mut self.pool, &self.device, sign, &needed, &changed) {
            // Wrapping sums form a group: the opposite update restores every bit.
            let passes: Vec<Pass> = split.update(mode(sign.opposite())).collect();
            let undone = self.fuser.submit(&self.device, &self.pool, &frame, &passes);
            undone.map_err(|error| self.device.lose(error))?;
            return Err(refusal);
        }
        let added = Split::added(&mut self.pool, &needed);
        let passes: Vec<Pass> = added.update(Mode::Plus).collect();
        let done = self.fuser.submit(&self.device, &self.pool, &frame, &passes);
        done.map_err(|error| self.device.lose(error))?;
        let emptied: Vec<Key> = changed.iter().filter(|work| !work.1.observed()).map(|work| work.0).collect();
        for &key in &emptied {
            self.pool.remove(key);
        }
        Ok(FrameReport {
            valid_pixels: self.surface.valid,
            fused_pixels: self.surface.fused,
            voxels: needed.iter().chain(&changed).map(|work| work.1.voxels()).sum(),
            blocks: needed.len() + changed.len(),
            blocks_added: needed.len(),
            blocks_removed: emptied.len(),
            blocks_left: 0,
            blocks_arrived: 0,
            blocks_overdue: 0,
        })
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
        self.apply(Sign::Plus, depth, colour, world_from_camera)
    }

    fn deintegrate(
        &mut self,
        depth: &DepthView,
        colour: Option<&ColourView>,
        world_from_camera: &Isometry3<f64>,
    ) -> Result<FrameReport, Error> {
        self.apply(Sign::Minus, depth, colour, world_from_camera)
    }

    fn ray_cast(
        &mut self,
        intrinsics: &Intrinsics,
        width: usize,
        height: usize,
        world_from_camera: &Isometry3<f64>,
        settings: &CastSettings,
    ) -> Result<View, Error> {
        settings.check()?;
        check_sides("view", width, height)?;
        intrinsics.check("view")?;
        check_pose(world_from_camera)?;
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
            hash = fold(hash, key, block.print());
            Ok(())
        })?;
        Ok(hash)
    }

    fn mesh(&self) -> Result<Mesh, Error> {
        Ok(self.to_map(usize::MAX)?.mesh())
    }
}

/// A map on the GPU or, where none can be used, on the processor, with the reason: one line for the caller's log.
///
/// # Errors
/// Settings that make no sense, and those of [`Map::new`].
pub fn open_map(settings: Settings, options: &GpuOptions) -> Result<(Box<dyn DenseMap>, Option<String>), Error> {
    match GpuMap::new(settings, options) {
        Ok(map) => Ok((Box::new(map), None)),
        Err(error @ (Error::NoAdapter { .. } | Error::Device { .. })) => {
            Ok((Box::new(Map::new(settings)?), Some(format!("mapping on the processor: {error}"))))
        }
        Err(error) => Err(error),
    }
}

#[cfg(test)]
mod tests {
    use super::GpuOptions;
    use super::device::Device;

    /// Options that open some adapter; `None`, said aloud, where there is none and none is demanded.
    pub(super) fn options() -> Option<GpuOptions> {
        let options = GpuOptions { software: true, ..GpuOptions::default() };
        match Device::open(&options) {
            Ok(_) => Some(options),
            Err(error) if std::env::var_os("PAINTCOPTER_REQUIRE_GPU").is_none_or(|v| v != "1") => {
                eprintln!("skipped: {error}");
                None
            }
            Err(error) => panic!("PAINTCOPTER_REQUIRE_GPU=1, but {error}"),
        }
    }
}
