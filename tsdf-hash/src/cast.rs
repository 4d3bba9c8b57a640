//! What the map looks like from a pose.

mod arrivals;
pub(crate) mod camera;
mod cell;
pub(crate) mod fields;
mod lanes;
pub(crate) mod march;
mod remap;
mod splat;
pub(crate) mod tiles;

pub use arrivals::{ArrivalSettings, ArrivalView};
use camera::Camera;
use fields::Fields;
use nalgebra::Isometry3;
use tiles::Tiles;

use crate::parallel::in_chunks;
use crate::view::{Intrinsics, check_pose, check_sides};
use crate::{Error, Map};

/// Colour of pixels that no colour image has seen.
pub(crate) const UNSEEN: [u8; 3] = [128; 3];

/// Settings of [`Map::ray_cast`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct CastSettings {
    /// Surfaces nearer than this along the optical axis are not seen, metres (ours: 0.1).
    pub min_depth: f64,
    /// Surfaces farther than this are not seen, metres (ours: 6, as [`Settings::max_depth`](crate::Settings)).
    pub max_depth: f64,
    /// Whether colours are wanted; without them the cast is a little faster.
    pub colour: bool,
    /// Threads used inside one call; 1 spawns none. Results do not depend on it.
    pub threads: usize,
}

impl Default for CastSettings {
    fn default() -> Self {
        Self { min_depth: 0.1, max_depth: 6.0, colour: true, threads: 1 }
    }
}

impl CastSettings {
    pub(crate) fn check(&self) -> Result<(), Error> {
        let within = |name, value: f64, lo: f64, hi: f64, requirement| {
            // A comparison that a NaN fails.
            if value >= lo && value <= hi { Ok(()) } else { Err(Error::InvalidSetting { name, value, requirement }) }
        };
        within("min_depth", self.min_depth, 1e-3, 1e3, "0.001..=1000 metres")?;
        within("max_depth", self.max_depth, 1e-3, 1e3, "0.001..=1000 metres")?;
        within("max_depth", self.max_depth - self.min_depth, 1e-6, 1e3, "larger than min_depth")?;
        within("threads", self.threads as f64, 1.0, 1024.0, "1..=1024")
    }
}

/// The map as a camera would see it; row-major, `width * height` entries each.
///
/// A view keeps the buffers it was made with, so that a view used again allocates nothing in the long run.
#[derive(Clone, Debug, Default)]
pub struct View {
    /// Pixels per row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// The camera; `None` before the first cast.
    pub intrinsics: Option<Intrinsics>,
    /// Where it stood.
    pub world_from_camera: Isometry3<f64>,
    /// z along the optical axis, metres; 0 where nothing was hit.
    pub depth: Vec<f32>,
    /// Unit normals in the world, towards the free side; zero where nothing was hit.
    pub normals: Vec<[f32; 3]>,
    /// R, G, B; mid-grey where no colour was seen, and everywhere if none was asked for.
    pub colours: Vec<[u8; 3]>,
    /// Weight `W` of the voxel nearest to the hit; 0 where nothing was hit.
    pub weights: Vec<u16>,
    scratch: Scratch,
}

/// Working memory of a cast.
#[derive(Clone, Debug, Default)]
struct Scratch {
    fields: Fields,
    tiles: Tiles,
}

/// One pixel of a view.
#[derive(Clone, Copy)]
struct Pixel {
    depth: f32,
    normal: [f32; 3],
    colour: [u8; 3],
    weight: u16,
}

impl Pixel {
    const NONE: Self = Self { depth: 0.0, normal: [0.0; 3], colour: UNSEEN, weight: 0 };
}

/// Rows of a view that one thread fills, from row `first` on.
struct Band<'a> {
    first: usize,
    depth: &'a mut [f32],
    normals: &'a mut [[f32; 3]],
    colours: &'a mut [[u8; 3]],
    weights: &'a mut [u16],
}

impl Band<'_> {
    fn set(&mut self, at: usize, pixel: &Pixel) {
        self.depth[at] = pixel.depth;
        self.normals[at] = pixel.normal;
        self.colours[at] = pixel.colour;
        self.weights[at] = pixel.weight;
    }
}

impl View {
    /// An empty view, to be filled by [`Map::ray_cast_into`].
    pub fn new() -> Self {
        Self::default()
    }

    /// Pixels where a surface was hit.
    pub fn hits(&self) -> usize {
        self.depth.iter().filter(|z| **z > 0.0).count()
    }

    pub(crate) fn resize(
        &mut self,
        camera: &Intrinsics,
        (width, height): (usize, usize),
        world_from_camera: &Isometry3<f64>,
    ) {
        (self.width, self.height) = (width, height);
        self.intrinsics = Some(*camera);
        self.world_from_camera = *world_from_camera;
        let pixels = width * height;
        self.depth.resize(pixels, 0.0);
        self.normals.resize(pixels, [0.0; 3]);
        self.colours.resize(pixels, UNSEEN);
        self.weights.resize(pixels, 0);
    }
}

impl Map {
    /// The surface as a camera at `world_from_camera` sees it, by casting one ray per pixel through the blocks.
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
        settings: &CastSettings,
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
        settings: &CastSettings,
        view: &mut View,
    ) -> Result<(), Error> {
        settings.check()?;
        check_sides("view", width, height)?;
        intrinsics.check("view")?;
        check_pose(world_from_camera)?;
        let camera = Camera::new(intrinsics, (width, height), world_from_camera, self.settings(), settings)?;
        view.resize(intrinsics, (width, height), world_from_camera);
        let mut scratch = std::mem::take(&mut view.scratch);
        scratch.fields.select(self.store(), &camera, settings);
        scratch.tiles.fill(&scratch.fields.places, &camera);
        let rows = height.div_ceil(settings.threads).next_multiple_of(tiles::SIDE);
        let chunk = rows * width;
        let mut bands: Vec<Band> = (view.depth.chunks_mut(chunk).zip(view.normals.chunks_mut(chunk)))
            .zip(view.colours.chunks_mut(chunk).zip(view.weights.chunks_mut(chunk)))
            .enumerate()
            .map(|(k, ((depth, normals), (colours, weights)))| Band {
                first: k * rows,
                depth,
                normals,
                colours,
                weights,
            })
            .collect();
        in_chunks(&mut bands, settings.threads, |bands| {
            for band in bands {
                march::fill(band, &camera, &scratch.fields, &scratch.tiles, settings.colour);
            }
        });
        view.scratch = scratch;
        Ok(())
    }
}
