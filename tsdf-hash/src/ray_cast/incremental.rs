//! The ray cast of what comes back, kept up to date block by block (thesis Paper I, section 4.4).

use nalgebra::{Isometry3, Point3, Vector3};

use crate::blocks::block_key::BlockKey;
use crate::blocks::voxel_block::{SIDE, VOXELS, VoxelBlock};
use crate::error::Error;
use crate::images::{Intrinsics, check_pose, check_sides};
use crate::ray_cast::forward_projection::splat_view;
use crate::ray_cast::pixel::{Pixel, UNSEEN};
use crate::ray_cast::splat::{Raster, Surfel, Target};
use crate::ray_cast::view::View;
use crate::settings::Settings;
use crate::storage::reloaded::{ReloadedBlocks, ReloadedVersion};

/// Settings of an [`IncrementalRayCast`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct IncrementalRayCastSettings {
    /// `α` of thesis Eq. (5.4), the part of the observations in the reliability, `0..=1`; `β = 1 − α`, so that it stays in
    /// `0..=1` as claimed there (not printed; ours: 0.5).
    pub alpha: f64,
    /// `n_max` of Eq. (5.4), in weights `W`: with more a voxel is no more reliable (not printed; ours: 100, seven frames
    /// from near or three seconds from afar).
    pub max_weight: f64,
    /// What is left of the reliability in pixels beside the one that a point falls into (not printed; ours: 0.9).
    pub neighbour_share: f64,
    /// Surfaces nearer than this along the optical axis are not seen, metres (ours: 0.1).
    pub min_depth: f64,
    /// Surfaces farther than this are not seen, metres (ours: 6).
    pub max_depth: f64,
}

impl Default for IncrementalRayCastSettings {
    fn default() -> Self {
        Self { alpha: 0.5, max_weight: 100.0, neighbour_share: 0.9, min_depth: 0.1, max_depth: 6.0 }
    }
}

impl IncrementalRayCastSettings {
    fn check(&self) -> Result<(), Error> {
        let within = |name, value: f64, lo: f64, hi: f64, requirement| {
            // A comparison that a NaN fails.
            if value >= lo && value <= hi { Ok(()) } else { Err(Error::InvalidSetting { name, value, requirement }) }
        };
        within("alpha", self.alpha, 0.0, 1.0, "0..=1")?;
        within("max_weight", self.max_weight, 1.0, 65535.0, "1..=65535")?;
        within("neighbour_share", self.neighbour_share, 0.0, 1.0, "0..=1")?;
        within("min_depth", self.min_depth, 1e-3, 1e3, "0.001..=1000 metres")?;
        within("max_depth", self.max_depth, 1e-3, 1e3, "0.001..=1000 metres")?;
        within("max_depth", self.max_depth - self.min_depth, 1e-6, 1e3, "larger than min_depth")
    }

    /// Thesis Eq. (5.4), with the distance as a share of `μ`.
    fn reliability(&self, weight: u16, distance: f32) -> f32 {
        let observed = (f64::from(weight) / self.max_weight).min(1.0);
        (self.alpha * observed + (1.0 - self.alpha) * (1.0 - f64::from(distance.abs()))) as f32
    }
}

/// `R*` of the thesis: what the surface looked like when it was last seen, from the blocks that have been reloaded.
///
/// Each [`update`](Self::update) projects the pixels that it has into the new camera and adds the surface points of the
/// blocks that were reloaded since; no block is read twice for long. Compare the result with a ray cast of the map, or
/// with the image of the camera, to find how far the pose has drifted before [`Map::merge_reloaded`](crate::Map::merge_reloaded)
/// merges the blocks. Keep one for each viewpoint: what is outside the image is forgotten.
#[derive(Clone, Debug, Default)]
pub struct IncrementalRayCast {
    settings: IncrementalRayCastSettings,
    view: View,
    reliability: Vec<f32>,
    /// Blocks whose points are all in the view, as they were then, ascending.
    complete: Vec<ReloadedVersion>,
    raster: Raster,
}

impl IncrementalRayCast {
    /// An empty view.
    ///
    /// # Errors
    /// [`Error::InvalidSetting`].
    pub fn new(settings: IncrementalRayCastSettings) -> Result<Self, Error> {
        settings.check()?;
        Ok(Self { settings, ..Self::default() })
    }

    /// The old surface as the camera of the last update sees it.
    pub fn view(&self) -> &View {
        &self.view
    }

    /// Reliability of each pixel, row-major, thesis Eq. (5.4); 0 where nothing is seen.
    pub fn reliability(&self) -> &[f32] {
        &self.reliability
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        let settings = self.settings;
        *self = Self { settings, ..Self::default() };
    }

    /// Thesis Eq. (5.6): the pixels from before, forward projected, and the surface points of the blocks that are new;
    /// returns how many blocks were read.
    ///
    /// A voxel at `x` with distance `s` stands for the point `x − s n`, with `n` the gradient from its neighbours. The
    /// thesis, Eq. (5.5), goes `s` along the ray from the camera, which is right for distances along the rays of this
    /// very camera only. In each pixel the points within `μ` of the nearest compete and the most reliable wins (the
    /// printed rule has no depth test, so a wall behind might win); points that face away are left out. A point covers the
    /// pixels within `f h / 2z` of its projection, with [`neighbour_share`](IncrementalRayCastSettings::neighbour_share) of its reliability outside its
    /// own one; that, and closing gaps of one pixel, replaces the random neighbour that the paper gives
    /// colliding points to.
    ///
    /// A block that is only partly in the image counts as new again the next time.
    ///
    /// # Errors
    /// [`Error::InvalidSize`], [`Error::InvalidIntrinsics`], [`Error::InvalidPose`]. The view is then as it was.
    pub fn update(
        &mut self,
        reloaded: &ReloadedBlocks,
        intrinsics: &Intrinsics,
        (width, height): (usize, usize),
        world_from_camera: &Isometry3<f64>,
    ) -> Result<usize, Error> {
        check_sides("view", width, height)?;
        intrinsics.check("view")?;
        check_pose(world_from_camera)?;
        let settings = reloaded.settings();
        let depths = [self.settings.min_depth, self.settings.max_depth];
        let target = Target::new(intrinsics, (width, height), world_from_camera, depths);
        self.raster.clear();
        let old_pixels = self.view.depth.len();
        splat_view(&self.view, &target, |at| self.reliability[at], &mut self.raster)?;
        let mut fresh: Vec<Pixel> = Vec::new();
        let (mut complete, mut read) = (Vec::new(), 0);
        for version in reloaded.versions() {
            if self.complete.binary_search(&version).is_ok() {
                complete.push(version);
                continue;
            }
            if behind(version.key, settings, &target) {
                continue;
            }
            read += 1;
            let mut whole = true;
            each_point(reloaded, version.key, |point| {
                let source = (old_pixels + fresh.len()) as u32;
                let score = self.settings.reliability(point.weight, point.distance);
                let (size, normal) = (settings.voxel_size, point.normal);
                let surfel = Surfel { point: point.position, normal, size, cosine: 1.0, stretch: 1.0 };
                let splat = target.splat(&surfel, score, source);
                whole &= splat.is_some_and(|splat| splat.inside((width, height)));
                if let Some(splat) = splat {
                    self.raster.push(splat);
                    let normal = point.normal.cast::<f32>().into();
                    fresh.push(Pixel { depth: 0.0, normal, colour: point.colour, weight: point.weight });
                }
            });
            if whole {
                complete.push(version);
            }
        }
        self.complete = complete;
        let band = settings.truncation() as f32;
        let neighbour_share = self.settings.neighbour_share as f32;
        self.raster.draw((width, height), neighbour_share, |nearest| nearest / (1.0 + band * nearest));
        self.show(&fresh, intrinsics, (width, height), world_from_camera);
        Ok(read)
    }

    /// Makes what was drawn the view.
    fn show(
        &mut self,
        fresh: &[Pixel],
        intrinsics: &Intrinsics,
        size: (usize, usize),
        world_from_camera: &Isometry3<f64>,
    ) {
        let before = std::mem::take(&mut self.view);
        let old_pixels = before.depth.len();
        self.view.resize(intrinsics, size, world_from_camera);
        self.reliability.clear();
        self.reliability.resize(size.0 * size.1, 0.0);
        for (at, shown) in self.raster.pixels().enumerate() {
            let Some((shown, source)) = shown else { continue };
            let depth = 1.0 / shown.inverse;
            let pixel = if source < old_pixels {
                before.pixel(source, depth)
            } else {
                Pixel { depth, ..fresh[source - old_pixels] }
            };
            self.view.put(at, &pixel);
            self.reliability[at] = shown.score;
        }
    }
}

/// Whether a block is nearer than the camera sees.
fn behind(key: BlockKey, settings: &Settings, target: &Target) -> bool {
    let centre = Point3::from(key.block().map(|c| (f64::from(c) + 0.5) * settings.block_size()));
    // Points lie up to the truncation distance from their voxels.
    let radius = 0.5 * 3.0_f64.sqrt() * settings.block_size() + settings.truncation();
    target.in_camera(&centre).z + radius < target.depths[0]
}

/// A point of the surface, from one voxel.
struct Point {
    position: Point3<f64>,
    normal: Vector3<f64>,
    /// Of the voxel, as a share of `μ`.
    distance: f32,
    weight: u16,
    colour: [u8; 3],
}

/// The points of the voxels of a reloaded block whose distance and gradient are known.
fn each_point(reloaded: &ReloadedBlocks, key: BlockKey, mut work: impl FnMut(Point)) {
    let settings = reloaded.settings();
    let Some(around) = BlockNeighbourhood::of(reloaded, key) else { return };
    let corner = Vector3::from(key.block().map(|c| f64::from(c) * settings.block_size()));
    for voxel in 0..VOXELS {
        let Some(distance) = known(around.block, voxel) else { continue };
        let at = [voxel % SIDE, voxel / SIDE % SIDE, voxel / (SIDE * SIDE)];
        let Some(normal) = around.gradient(at, distance).and_then(|gradient| gradient.try_normalize(1e-3)) else {
            continue;
        };
        let centre = corner + Vector3::from(at.map(|c| (c as f64 + 0.5) * settings.voxel_size));
        let position = Point3::from(centre - normal * (f64::from(distance) * settings.truncation()));
        let colour = around.block.mean_colour(voxel).map_or(UNSEEN, |rgb| rgb.map(|c| (c + 0.5).min(255.0) as u8));
        work(Point { position, normal, distance, weight: around.block.weight[voxel], colour });
    }
}

/// Mean of a voxel; at one it is cut off, and says nothing.
fn known(block: &VoxelBlock, voxel: usize) -> Option<f32> {
    block.mean(voxel).filter(|distance| distance.abs() < 1.0)
}

/// A reloaded block and those beside it.
struct BlockNeighbourhood<'a> {
    block: &'a VoxelBlock,
    /// Lower and upper neighbour along each axis.
    beside: [[Option<&'a VoxelBlock>; 2]; 3],
}

impl<'a> BlockNeighbourhood<'a> {
    fn of(reloaded: &'a ReloadedBlocks, key: BlockKey) -> Option<Self> {
        let neighbour = |axis: usize, step: i32| {
            let mut steps = [0; 3];
            steps[axis] = step;
            reloaded.block(key.neighbour(steps)?)
        };
        let beside = [0, 1, 2].map(|axis| [neighbour(axis, -1), neighbour(axis, 1)]);
        Some(Self { block: reloaded.block(key)?, beside })
    }

    /// Per voxel, in `μ`: central differences, or one-sided ones where a neighbour is unknown; `None` where both are.
    fn gradient(&self, at: [usize; 3], distance: f32) -> Option<Vector3<f64>> {
        let mut gradient = Vector3::zeros();
        for axis in 0..3 {
            let rise = match [self.next(at, axis, false), self.next(at, axis, true)] {
                [Some(lower), Some(upper)] => 0.5 * (upper - lower),
                [Some(lower), None] => distance - lower,
                [None, Some(upper)] => upper - distance,
                [None, None] => return None,
            };
            gradient[axis] = f64::from(rise);
        }
        Some(gradient)
    }

    /// Mean of the next voxel along an axis, unless it is cut off.
    fn next(&self, at: [usize; 3], axis: usize, up: bool) -> Option<f32> {
        let last = if up { SIDE - 1 } else { 0 };
        let block = if at[axis] == last { self.beside[axis][usize::from(up)]? } else { self.block };
        let mut next = at;
        next[axis] = (at[axis] + if up { 1 } else { SIDE - 1 }) % SIDE;
        known(block, next[0] + SIDE * (next[1] + SIDE * next[2]))
    }
}
