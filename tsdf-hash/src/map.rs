//! The map: fuse, take out, ask.

use std::path::Path;

use nalgebra::Isometry3;

use crate::block::Block;
use crate::fuse::{Frame, Sign};
use crate::settings::Tiers;
use crate::store::Store;
use crate::surface::Surface;
use crate::tiers::{Arrivals, Copies, Moment, Moves, Revisit, Swap, Verdict};
use crate::view::{ColourView, DepthView, check_pose};
use crate::{Error, Settings};

/// What a frame did to the map.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameReport {
    /// Pixels with a depth between `min_depth` and `max_depth`.
    pub valid_pixels: usize,
    /// Those of them that lie on smooth patches, seen not too steeply: the ones that are fused.
    pub fused_pixels: usize,
    /// Voxels that were updated.
    pub voxels: usize,
    /// Blocks with such voxels.
    pub blocks: usize,
    /// Blocks that were not there before.
    pub blocks_added: usize,
    /// Blocks that are no longer there.
    pub blocks_removed: usize,
    /// Blocks that left active memory by age.
    pub blocks_left: usize,
    /// Blocks that came back because the frame saw them again.
    pub blocks_arrived: usize,
    /// Blocks that were held for longer than [`Tiers::hold`] and were merged without a verdict.
    pub blocks_overdue: usize,
}

/// Bytes and blocks of each tier. A block that has left and was seen again may have a copy in several.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Memory {
    /// Active memory, held blocks included; capped by [`Settings::max_bytes`].
    pub active_bytes: usize,
    /// The host tier and the index of all cold blocks; capped by [`Tiers::host_bytes`].
    pub host_bytes: usize,
    /// Length of the swap file; capped by [`Tiers::disk_bytes`].
    pub disk_bytes: u64,
    /// Blocks in active memory, without those that are held.
    pub active_blocks: usize,
    /// Blocks that have come back and wait for a verdict.
    pub held_blocks: usize,
    /// Packed blocks in RAM.
    pub host_blocks: usize,
    /// Packed blocks in the swap file.
    pub disk_blocks: usize,
    /// Packed blocks that are still in the file that the map was opened from.
    pub file_blocks: usize,
}

/// Seconds that pass with a frame of unknown time: the usual camera takes 30 a second.
const FRAME_PERIOD: f64 = 1.0 / 30.0;

/// A truncated signed distance field in hashed blocks of 8³ voxels.
///
/// The voxel `(i, j, k)` has its centre at `(i + ½, j + ½, k + ½) h` in the world; the block of a point is
/// `floor(point / 8h)`. Distances are positive on the side of the camera.
pub struct Map {
    pub(crate) settings: Settings,
    pub(crate) copies: Copies,
    surface: Surface,
    pub(crate) clock: Clock,
}

/// The time of the last frame.
#[derive(Clone, Copy, Default)]
pub(crate) struct Clock {
    pub(crate) last: Option<f64>,
    /// Whether any frame came with its time.
    pub(crate) stamped: bool,
}

impl Map {
    /// An empty map.
    ///
    /// # Errors
    /// [`Error::InvalidSetting`], and [`Error::SwapFile`] when there is to be a disk tier.
    pub fn new(settings: Settings) -> Result<Self, Error> {
        settings.check()?;
        if settings.tiers.disk_bytes > 0 {
            return Err(Error::SwapFile { disk_bytes: settings.tiers.disk_bytes });
        }
        Self::with_copies(settings, None)
    }

    /// An empty map with a disk tier in the file `swap`, which is created, or emptied, and removed with the map.
    ///
    /// # Errors
    /// [`Error::InvalidSetting`], [`Error::SwapFile`] without a disk tier, [`Error::Io`].
    pub fn with_swap(settings: Settings, swap: &Path) -> Result<Self, Error> {
        settings.check()?;
        if settings.tiers.disk_bytes == 0 {
            return Err(Error::SwapFile { disk_bytes: 0 });
        }
        let swap = Swap::create(swap, settings.tiers.disk_bytes);
        Self::with_copies(settings, Some(swap.map_err(|source| Error::Io { what: "creating the swap file", source })?))
    }

    fn with_copies(settings: Settings, swap: Option<Swap>) -> Result<Self, Error> {
        let copies = Copies::new(settings.max_bytes, settings.tiers, swap)?;
        Ok(Self { settings, copies, surface: Surface::default(), clock: Clock::default() })
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
    /// [`Error::Saturated`], and with tiers [`Error::TiersFull`], [`Error::Io`], [`Error::Damaged`]. The map is then as it
    /// was.
    pub fn integrate(
        &mut self,
        depth: &DepthView,
        colour: Option<&ColourView>,
        world_from_camera: &Isometry3<f64>,
    ) -> Result<FrameReport, Error> {
        let time = self.clock.last.map_or(0.0, |last| if self.clock.stamped { last } else { last + FRAME_PERIOD });
        let report = self.apply(Sign::Plus, depth, colour, world_from_camera, time)?;
        self.clock.last = Some(time);
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
        let last = self.clock.last.unwrap_or(f64::MIN);
        if !(time.is_finite() && time > last) {
            return Err(Error::InvalidTime { time, last });
        }
        let report = self.apply(Sign::Plus, depth, colour, world_from_camera, time)?;
        self.clock = Clock { last: Some(time), stamped: true };
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
        self.apply(Sign::Minus, depth, colour, world_from_camera, self.clock.last.unwrap_or(0.0))
    }

    fn apply(
        &mut self,
        sign: Sign,
        depth: &DepthView,
        colour: Option<&ColourView>,
        world_from_camera: &Isometry3<f64>,
        time: f64,
    ) -> Result<FrameReport, Error> {
        depth.check()?;
        if let Some(colour) = colour {
            colour.check()?;
        }
        check_pose(world_from_camera)?;
        self.surface.read(depth, world_from_camera, &self.settings)?;
        let frame = Frame::new(&self.surface, &depth.intrinsics, colour, world_from_camera, &self.settings);
        let eye = world_from_camera.translation.vector / self.settings.block_size();
        let moment = Moment { time, eye: eye.into() };
        let change = self.copies.change(&frame, sign, &self.surface.keys, moment, self.settings.threads)?;
        let moves = match sign {
            Sign::Plus => self.copies.settle(&change.touched, time),
            Sign::Minus => Moves::default(),
        };
        Ok(FrameReport {
            valid_pixels: self.surface.valid,
            fused_pixels: self.surface.fused,
            voxels: change.voxels,
            blocks: change.blocks,
            blocks_added: change.added,
            blocks_removed: change.removed,
            blocks_left: moves.left,
            blocks_arrived: moves.arrived,
            blocks_overdue: moves.overdue,
        })
    }

    /// Bytes in active memory: what [`Settings::max_bytes`] caps. The working memory of a call (about 17 bytes per pixel)
    /// and the meshes handed out are not in it.
    pub fn bytes(&self) -> usize {
        self.copies.active_bytes()
    }

    /// Where the blocks are, and the bytes they take.
    pub fn memory(&self) -> Memory {
        let [host_blocks, disk_blocks, file_blocks] = self.copies.cold.counts();
        Memory {
            active_bytes: self.bytes(),
            host_bytes: self.copies.cold.host_bytes(),
            disk_bytes: self.copies.cold.disk_bytes(),
            active_blocks: self.copies.active.len(),
            held_blocks: self.copies.held.len(),
            host_blocks,
            disk_blocks,
            file_blocks,
        }
    }

    /// Number of blocks in all tiers, of 7168 bytes each when active.
    pub fn blocks(&self) -> usize {
        self.copies.len()
    }

    /// A hash of all voxels in all tiers, in the order of the block coordinates: equal for equal maps, whatever the order
    /// of the frames, the number of threads, and the memory they were given.
    pub fn hash(&self) -> u64 {
        self.copies.hash()
    }

    /// The blocks that have come back and are held, to be looked at.
    pub fn arrivals(&self) -> Arrivals<'_> {
        Arrivals { held: &self.copies.held, active: self }
    }

    /// Asks for a verdict about the blocks that are held, if there are any, and returns how many were merged.
    ///
    /// # Errors
    /// Those of the tiers, when a held block has to make room. The map's sums are as they were.
    pub fn revisit(&mut self, revisit: &mut dyn Revisit) -> Result<usize, Error> {
        if self.arrivals().is_empty() {
            return Ok(0);
        }
        match revisit.judge(&self.arrivals()) {
            Verdict::Merge => self.copies.merge_held(),
            Verdict::Hold => Ok(0),
        }
    }

    /// A copy of the whole map in active memory without a cap, to mesh or to query.
    ///
    /// # Errors
    /// [`Error::Io`] and [`Error::Damaged`] when a block cannot be read.
    pub fn whole(&self) -> Result<Self, Error> {
        let settings = Settings { max_bytes: usize::MAX, tiers: Tiers::default(), ..self.settings };
        let mut whole = Self::new(settings)?;
        for key in self.copies.sorted_keys() {
            let mut sum = Box::new(Block::ZERO);
            let seen = self.copies.total(key, &mut sum)?;
            whole.copies.active.insert(key, sum, seen);
        }
        Ok(whole)
    }

    pub(crate) fn store(&self) -> &Store {
        &self.copies.active
    }
}
