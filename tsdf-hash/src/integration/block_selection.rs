//! Which blocks may hold a voxel that is up to `μ` behind a measured depth, and up to `μ` or as far as space is carved in
//! front of it.
//!
//! A superset is enough: fusion tests every voxel itself, so what is found here changes the time and never the map.

use nalgebra::{Isometry3, Point3, Vector3};

use crate::blocks::block_key::BlockKey;
use crate::error::Error;
use crate::hashing::mix64;
use crate::images::DepthView;
use crate::integration::plane_tile::{TILE, Tile};
use crate::integration::rims::reach;
use crate::settings::Settings;

/// Tiles along the edge of a square that is looked at as one where it is flat.
const SQUARE: usize = 2;
/// Boxes remembered, to drop repetitions.
const BOXES: usize = 64;
/// Keys remembered, to drop most repetitions before sorting.
const RECENT: usize = 4096;

/// Keys of the blocks near the pixels of some rows, in no order, with repetitions.
pub(crate) fn select_blocks(
    first_row: usize,
    omegas: &[f32],
    tiles: &[Tile],
    depth: &DepthView,
    world_from_camera: &Isometry3<f64>,
    settings: &Settings,
) -> Result<Vec<BlockKey>, Error> {
    let width = depth.width;
    let rows = omegas.len() / width;
    let mut search = Search {
        first_row,
        omegas,
        depth,
        origin: world_from_camera.translation.vector / settings.block_size(),
        rotation: world_from_camera.rotation.to_rotation_matrix().into_inner() / settings.block_size(),
        // A little more than that: the voxels are projected in single precision.
        reach: [settings.front(), settings.truncation()].map(|reach| reach * 1.001 + 1e-4 * settings.voxel_size),
        block: settings.block_size(),
        found: Covered::new(),
    };
    let across = width.div_ceil(TILE);
    for (v, lines) in tiles.chunks(SQUARE * across).enumerate() {
        for u in (0..across).step_by(SQUARE) {
            let square = lines.chunks(across).flat_map(|line| &line[u..(u + SQUARE).min(across)]);
            let range = square.fold([f32::INFINITY, 0.0_f32], |r, tile| [r[0].min(tile.near), r[1].max(tile.far)]);
            search.square([u * TILE, v * SQUARE * TILE], lines, rows, range)?;
        }
    }
    Ok(search.found.keys)
}

/// Keys of the blocks around the rims at some pixels of near surfaces, with their inverse depths.
pub(crate) fn select_around_rims(
    sources: impl Iterator<Item = ([usize; 2], f32)>,
    depth: &DepthView,
    world_from_camera: &Isometry3<f64>,
    settings: &Settings,
) -> Result<Vec<BlockKey>, Error> {
    let mut keys = Covered::new();
    let (k, reach) = (&depth.intrinsics, f64::from(reach(settings)[1]));
    let pixel = (1.0 / k.fx).abs().max((1.0 / k.fy).abs());
    for ([u, v], omega) in sources {
        let z = 1.0 / f64::from(omega);
        let ray = Vector3::new((u as f64 - k.cx) / k.fx, (v as f64 - k.cy) / k.fy, 1.0);
        let middle = world_from_camera * Point3::from(ray * z);
        // Along the ray, and to both sides in the image: the last pixel is not cut off, and a voxel may be half a pixel farther.
        let aside = (reach + 1.5 * pixel * z) * (1.0 + reach / z);
        let around = Vector3::repeat(ray.norm() * reach + std::f64::consts::SQRT_2 * aside + 1e-4 * z);
        let [low, high] = [middle - around, middle + around].map(|p| p / settings.block_size());
        keys.cover(&low, &high)?;
    }
    Ok(keys.keys)
}

/// Keys of blocks, in no order, with repetitions.
struct Covered {
    /// The last boxes of blocks, by their lower corners: many lie in the same blocks as one before.
    boxes: [[Point3<i32>; 2]; BOXES],
    recent: Vec<BlockKey>,
    keys: Vec<BlockKey>,
}

struct Search<'a> {
    first_row: usize,
    omegas: &'a [f32],
    depth: &'a DepthView<'a>,
    /// Camera in the world, in blocks.
    origin: Vector3<f64>,
    /// Blocks in the world from metres in the camera.
    rotation: nalgebra::Matrix3<f64>,
    /// In front and behind.
    reach: [f64; 2],
    block: f64,
    found: Covered,
}

impl Search<'_> {
    /// Looks at a square of tiles together if their depths differ by less than a block, else at each.
    fn square(&mut self, [u, v]: [usize; 2], lines: &[Tile], rows: usize, range: [f32; 2]) -> Result<(), Error> {
        if f64::from(range[1] - range[0]) <= self.block {
            return self.tile([u, v], SQUARE * TILE, rows, range);
        }
        for (line, v) in lines.chunks(self.depth.width.div_ceil(TILE)).zip((v..).step_by(TILE)) {
            for (tile, u) in line.iter().zip((0..).step_by(TILE)).skip(u / TILE).take(SQUARE) {
                self.tile([u, v], TILE, rows, [tile.near, tile.far])?;
            }
        }
        Ok(())
    }

    /// Looks at a square of pixels whose range of depths is known; where that is deeper than a block, at each slice of its
    /// quarters in which there are depths.
    fn tile(&mut self, [u, v]: [usize; 2], side: usize, rows: usize, [near, far]: [f32; 2]) -> Result<(), Error> {
        if far < near {
            return Ok(());
        }
        let (right, below) = ((u + side).min(self.depth.width), (v + side).min(rows));
        let (near, far) = (f64::from(near), f64::from(far));
        if far - near <= self.block {
            return self.frustum([u, right], [v + self.first_row, below + self.first_row], near, far);
        }
        if side == TILE {
            let half = side / 2;
            for corner in [[u, v], [u + half, v], [u, v + half], [u + half, v + half]] {
                let range = self.range(corner, [(corner[0] + half).min(right), (corner[1] + half).min(below)]);
                self.tile(corner, half, rows, range)?;
            }
            return Ok(());
        }
        let slices = ((far - near) / self.block).ceil().min(f64::from(u64::BITS));
        let thickness = (far - near) / slices;
        let seen = self.slices([u, v], [right, below], near, thickness);
        let mut first = 0;
        while first < u64::BITS && seen >> first != 0 {
            let start = first + (seen >> first).trailing_zeros();
            let end = start + (seen >> start).trailing_ones();
            let range = [start, end].map(|slice| near + f64::from(slice) * thickness);
            self.frustum([u, right], [v + self.first_row, below + self.first_row], range[0], range[1])?;
            first = end;
        }
        Ok(())
    }

    /// Least and largest depth.
    fn range(&self, from: [usize; 2], to: [usize; 2]) -> [f32; 2] {
        let depths = self.depths(from, to);
        depths.fold([f32::INFINITY, 0.0], |[near, far], z| [near.min(z), far.max(z)])
    }

    /// In which slices from `near` on there are depths, a bit each.
    fn slices(&self, from: [usize; 2], to: [usize; 2], near: f64, thickness: f64) -> u64 {
        let slice = |z: f32| (((f64::from(z) - near) / thickness) as u32).min(u64::BITS - 1);
        self.depths(from, to).fold(0, |seen, z| seen | 1 << slice(z))
    }

    fn depths(&self, from: [usize; 2], to: [usize; 2]) -> impl Iterator<Item = f32> {
        let width = self.depth.width;
        let pixels = (from[1]..to[1]).filter_map(move |v| self.omegas.get(v * width + from[0]..v * width + to[0]));
        pixels.flatten().filter(|&&omega| omega > 0.0).map(|omega| 1.0 / omega)
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
            self.found.cover(&low.into(), &high.into())?;
        }
        Ok(())
    }
}

impl Covered {
    fn new() -> Self {
        Self {
            boxes: [[Point3::new(i32::MAX, 0, 0); 2]; BOXES],
            recent: vec![BlockKey(u64::MAX); RECENT],
            keys: Vec::new(),
        }
    }

    /// Adds the blocks that a box touches, its corners in blocks.
    fn cover(&mut self, low: &Point3<f64>, high: &Point3<f64>) -> Result<(), Error> {
        if low.iter().chain(high.iter()).any(|c| c.abs() > f64::from(1 << 20)) {
            return Err(Error::OutOfRange);
        }
        // `f64::floor` is a call where the processor is not known.
        let floor = |c: f64| c as i32 - i32::from(c < f64::from(c as i32));
        let [low, high] = [low, high].map(|p| p.map(floor));
        let known = &mut self.boxes[(low.x ^ low.y << 2 ^ low.z << 4) as usize % BOXES];
        if std::mem::replace(known, [low, high]) == [low, high] {
            return Ok(());
        }
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
