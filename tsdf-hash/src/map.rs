//! The map: fuse, take out, ask.

use std::sync::atomic::{AtomicUsize, Ordering};

use nalgebra::{Isometry3, Point3};

use crate::block::{Block, SIDE};
use crate::fuse::{Frame, Sign, Tally};
use crate::key::{Key, mix};
use crate::parallel::in_chunks;
use crate::store::Store;
use crate::surface::Surface;
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
}

/// A truncated signed distance field in hashed blocks of 8³ voxels.
///
/// The voxel `(i, j, k)` has its centre at `(i + ½, j + ½, k + ½) h` in the world; the block of a point is
/// `floor(point / 8h)`. Distances are positive on the side of the camera.
pub struct Map {
    settings: Settings,
    store: Store,
    surface: Surface,
}

impl Map {
    /// An empty map.
    pub fn new(settings: Settings) -> Result<Self, Error> {
        settings.check()?;
        Ok(Self { settings, store: Store::new(settings.max_bytes)?, surface: Surface::default() })
    }

    /// The settings given to [`new`](Self::new).
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Fuses a depth image, and a colour image taken from the same place, seen from `world_from_camera`.
    ///
    /// # Errors
    /// Views, intrinsics or pose that make no sense, [`Error::NoDepth`], [`Error::OutOfRange`], [`Error::OutOfBudget`],
    /// [`Error::Saturated`]. The map is then as it was.
    pub fn integrate(
        &mut self,
        depth: &DepthView,
        colour: Option<&ColourView>,
        world_from_camera: &Isometry3<f64>,
    ) -> Result<FrameReport, Error> {
        self.apply(Sign::Plus, depth, colour, world_from_camera)
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
        self.apply(Sign::Minus, depth, colour, world_from_camera)
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
        let (mut absent, mut present) = (Vec::new(), Vec::new());
        for &key in &self.surface.keys {
            match self.store.take(key) {
                Some(block) => present.push((key, block, Tally::default())),
                None => absent.push(key),
            }
        }
        let outcome = change(&frame, sign, &mut absent, &mut present, self.store.room(), self.settings.threads);
        let touched = present.iter().filter(|(_, _, tally)| tally.voxels > 0);
        let emptied: Vec<Key> = touched.clone().filter(|(_, block, _)| block.is_empty()).map(|work| work.0).collect();
        let mut report = FrameReport {
            valid_pixels: self.surface.valid,
            fused_pixels: self.surface.fused,
            voxels: touched.clone().map(|(_, _, tally)| tally.voxels).sum(),
            blocks: touched.count(),
            blocks_added: 0,
            blocks_removed: emptied.len(),
        };
        for (key, block, tally) in present {
            self.store.put(key, block);
            if tally.voxels > 0 {
                self.store.touch(key);
            }
        }
        let added = outcome.map_err(|refusal| match (refusal, sign) {
            (Refusal::NoRoom, _) => self.store.out_of_budget(),
            (Refusal::Fault(key), Sign::Plus) => Error::Saturated { block: key.block() },
            (Refusal::Fault(key), Sign::Minus) => Error::NotIntegrated { block: key.block() },
        })?;
        report.voxels += added.iter().map(|(_, _, tally)| tally.voxels).sum::<usize>();
        report.blocks += added.len();
        report.blocks_added = added.len();
        self.store.add(added.into_iter().map(|(key, block, _)| (key, block)).collect());
        for key in emptied {
            self.store.remove(key);
        }
        Ok(report)
    }

    /// Bytes of the blocks and of the table that finds them: what [`Settings::max_bytes`] caps. The working memory of a
    /// call (about 40 bytes per pixel) and the meshes handed out are not in it.
    pub fn bytes(&self) -> usize {
        self.store.bytes()
    }

    /// Number of blocks, 7168 bytes each.
    pub fn blocks(&self) -> usize {
        self.store.len()
    }

    /// A hash of all voxels in the order of the block coordinates: equal for equal maps, whatever the order of the frames
    /// or the number of threads.
    pub fn hash(&self) -> u64 {
        let mut hash = 0;
        for key in self.store.sorted_keys() {
            if let Some(block) = self.store.get(key) {
                hash = block.hash(mix(hash ^ key.0));
            }
        }
        hash
    }

    /// Signed distance from the nearest surface, metres, by trilinear interpolation; `None` where one of the eight voxels
    /// around the point was never observed (farther than `μ` from every surface, behind one, or unseen).
    pub fn distance(&self, point_in_world: &Point3<f64>) -> Option<f64> {
        let voxel = point_in_world.coords / self.settings.voxel_size - nalgebra::Vector3::repeat(0.5);
        let low = voxel.map(f64::floor);
        // A NaN fails; beyond this the key would fail below, and the cast must not saturate.
        if !low.iter().all(|c| c.abs() <= f64::from(1 << 24)) {
            return None;
        }
        let fraction = voxel - low;
        let mut distance = 0.0;
        for corner in 0..8 {
            let bit = [corner & 1, corner >> 1 & 1, corner >> 2];
            let index = [0, 1, 2].map(|axis| low[axis] as i32 + bit[axis]);
            let key = Key::new(index.map(|c| c.div_euclid(SIDE as i32)))?;
            let local = index.map(|c| c.rem_euclid(SIDE as i32) as usize);
            let mean = self.store.get(key)?.mean(local[0] + SIDE * (local[1] + SIDE * local[2]))?;
            let share: f64 = (0..3).map(|k| if bit[k] == 1 { fraction[k] } else { 1.0 - fraction[k] }).product();
            distance += share * f64::from(mean);
        }
        Some(distance * self.settings.truncation())
    }

    pub(crate) fn store(&self) -> &Store {
        &self.store
    }

    #[cfg(feature = "gpu")]
    pub(crate) fn store_mut(&mut self) -> &mut Store {
        &mut self.store
    }
}

type Work = (Key, Box<Block>, Tally);

/// Why a frame cannot be applied.
enum Refusal {
    NoRoom,
    Fault(Key),
}

/// Applies a frame to the blocks that exist and returns those it adds; after a refusal the blocks are as they were.
fn change(
    frame: &Frame,
    sign: Sign,
    absent: &mut [Key],
    present: &mut [Work],
    room: usize,
    threads: usize,
) -> Result<Vec<Work>, Refusal> {
    // Blocks that do not exist come first: whether they fit is known before anything has changed.
    let added = match sign {
        Sign::Plus => new_blocks(frame, absent, room, threads).ok_or(Refusal::NoRoom)?,
        Sign::Minus => match first_touched(frame, absent, threads) {
            Some(key) => return Err(Refusal::Fault(key)),
            None => Vec::new(),
        },
    };
    update(frame, sign, present, threads);
    match present.iter().find(|(_, _, tally)| tally.fault).map(|&(key, _, _)| key) {
        None => Ok(added),
        Some(key) => {
            // Wrapping sums form a group: the opposite update restores every bit.
            update(frame, sign.opposite(), present, threads);
            Err(Refusal::Fault(key))
        }
    }
}

fn update(frame: &Frame, sign: Sign, work: &mut [Work], threads: usize) {
    in_chunks(work, threads, |chunk| {
        for (key, block, tally) in chunk {
            *tally = frame.apply(sign, *key, block);
        }
    });
}

/// The blocks that the frame needs and that do not exist, already updated; `None` if there are more than `room`.
fn new_blocks(frame: &Frame, absent: &mut [Key], room: usize, threads: usize) -> Option<Vec<Work>> {
    let made = AtomicUsize::new(0);
    let parts = in_chunks(absent, threads, |keys| {
        let mut blank = Box::new(Block::ZERO);
        let mut part = Vec::new();
        for &mut key in keys {
            let tally = frame.apply(Sign::Plus, key, &mut blank);
            if tally.voxels > 0 {
                if made.fetch_add(1, Ordering::Relaxed) >= room {
                    return None;
                }
                part.push((key, blank.clone(), tally));
                *blank = Block::ZERO;
            }
        }
        Some(part)
    });
    let mut all = Vec::with_capacity(made.into_inner());
    for part in parts {
        all.extend(part?);
    }
    Some(all)
}

/// The first of these blocks that the frame would touch.
fn first_touched(frame: &Frame, absent: &mut [Key], threads: usize) -> Option<Key> {
    let parts = in_chunks(absent, threads, |keys| {
        let mut blank = Box::new(Block::ZERO);
        keys.iter().copied().find(|&key| frame.apply(Sign::Plus, key, &mut blank).voxels > 0)
    });
    parts.into_iter().flatten().next()
}
