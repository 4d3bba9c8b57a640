//! Which blocks may hold a voxel that is up to `μ` behind a measured depth, and up to `μ` or as far as space is carved in
//! front of it.
//!
//! A superset is enough: fusion tests every voxel itself, so what is found here changes the time and never the map.

use nalgebra::{Isometry3, Point3, Vector3};

use crate::blocks::block_key::BlockKey;
use crate::error::Error;
use crate::hashing::mix64;
use crate::images::DepthView;
use crate::integration::plane::Plane;
use crate::integration::plane_tile::{TILE, Tile};
use crate::settings::Settings;

/// Keys remembered, to drop most repetitions before sorting.
const RECENT: usize = 4096;

/// Keys of the blocks near the pixels of some rows, in no order, with repetitions.
pub(crate) fn select_blocks(
    first_row: usize,
    planes: &[Plane],
    tiles: &[Tile],
    depth: &DepthView,
    world_from_camera: &Isometry3<f64>,
    settings: &Settings,
) -> Result<Vec<BlockKey>, Error> {
    let width = depth.width;
    let rows = planes.len() / width;
    let mut search = Search {
        first_row,
        planes,
        depth,
        origin: world_from_camera.translation.vector / settings.block_size(),
        rotation: world_from_camera.rotation.to_rotation_matrix().into_inner() / settings.block_size(),
        // A little more than that: the voxels are projected in single precision.
        reach: [settings.front(), settings.truncation()].map(|reach| reach * 1.001 + 1e-4 * settings.voxel_size),
        block: settings.block_size(),
        recent: vec![BlockKey(u64::MAX); RECENT],
        keys: Vec::new(),
    };
    let across = width.div_ceil(TILE);
    for (k, &tile) in tiles.iter().enumerate() {
        search.tile([k % across * TILE, k / across * TILE], TILE, rows, [tile.near, tile.far])?;
    }
    Ok(search.keys)
}

struct Search<'a> {
    first_row: usize,
    planes: &'a [Plane],
    depth: &'a DepthView<'a>,
    /// Camera in the world, in blocks.
    origin: Vector3<f64>,
    /// Blocks in the world from metres in the camera.
    rotation: nalgebra::Matrix3<f64>,
    /// In front and behind.
    reach: [f64; 2],
    block: f64,
    recent: Vec<BlockKey>,
    keys: Vec<BlockKey>,
}

impl Search<'_> {
    /// Looks at a square of pixels whose range of depths is known; it is quartered where that is deeper than a block.
    fn tile(&mut self, [u, v]: [usize; 2], side: usize, rows: usize, [near, far]: [f32; 2]) -> Result<(), Error> {
        if far < near {
            return Ok(());
        }
        let (right, below) = ((u + side).min(self.depth.width), (v + side).min(rows));
        let (near, far) = (f64::from(near), f64::from(far));
        if far - near > self.block && side > 1 {
            let half = side / 2;
            for corner in [[u, v], [u + half, v], [u, v + half], [u + half, v + half]] {
                let range = self.range(corner, [(corner[0] + half).min(right), (corner[1] + half).min(below)]);
                self.tile(corner, half, rows, range)?;
            }
            return Ok(());
        }
        self.frustum([u, right], [v + self.first_row, below + self.first_row], near, far)
    }

    /// Least and largest depth.
    fn range(&self, from: [usize; 2], to: [usize; 2]) -> [f32; 2] {
        let width = self.depth.width;
        let pixels = (from[1]..to[1]).filter_map(|v| self.planes.get(v * width + from[0]..v * width + to[0])).flatten();
        let depths = pixels.filter_map(Plane::omega).map(|omega| 1.0 / omega);
        depths.fold([f32::INFINITY, 0.0], |[near, far], z| [near.min(z), far.max(z)])
    }

    /// Blocks that the bounding boxes of the frustum's slices touch.
    fn frustum(&mut self, u: [usize; 2], v: [usize; 2], near: f64, far: f64) -> Result<(), Error> {
        let k = &self.depth.intrinsics;
        let mut rays = [Vector3::zeros(); 4];
        for (n, ray) in rays.iter_mut().enumerate() {
            // Pixels reach half a pixel around their centres; a little more for the rounding.
            let edge =
                |range: [usize; 2], upper: usize| range[upper] as f64 - 0.5 + if upper == 0 { -0.01 } else { 0.01 };
            let pixel = [edge(u, n & 1), edge(v, n >> 1)];
            *ray = self.rotation * Vector3::new((pixel[0] - k.cx) / k.fx, (pixel[1] - k.cy) / k.fy, 1.0);
        }
        let (near, far) = ((near - self.reach[0]).max(0.0), far + self.reach[1]);
        let slices = ((far - near) / self.block).ceil();
        let step = (far - near) / slices;
        for slice in 0..slices as usize {
            let z = near + slice as f64 * step;
            let corners = rays.iter().flat_map(|ray| [self.origin + ray * z, self.origin + ray * (z + step)]);
            let (mut low, mut high) = (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
            for corner in corners {
                (low, high) = (low.inf(&corner), high.sup(&corner));
            }
            self.cover(&low.into(), &high.into())?;
        }
        Ok(())
    }

    fn cover(&mut self, low: &Point3<f64>, high: &Point3<f64>) -> Result<(), Error> {
        let [low, high] = [low, high].map(|p| p.coords.map(f64::floor));
        if low.iter().chain(high.iter()).any(|c| c.abs() > f64::from(1 << 20)) {
            return Err(Error::OutOfRange);
        }
        let [low, high] = [low, high].map(|p| p.map(|c| c as i32));
        for x in low.x..=high.x {
            for y in low.y..=high.y {
                for z in low.z..=high.z {
                    let key = BlockKey::new([x, y, z]).ok_or(Error::OutOfRange)?;
                    let recent = &mut self.recent[mix64(key.0) as usize % RECENT];
                    if *recent != key {
                        *recent = key;
                        self.keys.push(key);
                    }
                }
            }
        }
        Ok(())
    }
}
