//! The image that a ray cast makes.

use nalgebra::Isometry3;

use crate::images::Intrinsics;
use crate::ray_cast::pixel::{Pixel, UNSEEN};
use crate::ray_cast::tiles::Tiles;
use crate::ray_cast::unpacked::UnpackedBlocks;

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
    pub(crate) scratch: Scratch,
}

/// Working memory of a cast.
#[derive(Clone, Debug, Default)]
pub(crate) struct Scratch {
    pub(crate) blocks: UnpackedBlocks,
    pub(crate) tiles: Tiles,
}

impl View {
    /// An empty view, to be filled by [`Map::ray_cast_into`](crate::Map::ray_cast_into).
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

    /// A pixel of this view at another depth.
    pub(crate) fn pixel(&self, at: usize, depth: f32) -> Pixel {
        Pixel { depth, normal: self.normals[at], colour: self.colours[at], weight: self.weights[at] }
    }

    pub(crate) fn put(&mut self, at: usize, pixel: &Pixel) {
        self.depth[at] = pixel.depth;
        self.normals[at] = pixel.normal;
        self.colours[at] = pixel.colour;
        self.weights[at] = pixel.weight;
    }
}
