//! The depth camera that looks at a world.

use nalgebra::{Isometry3, Point3, Vector3};
use tsdf_hash::{ColourData, ColourView, DepthData, DepthView, Intrinsics, NoiseModel};

use super::world::{Seen, World};
use crate::Rng;

/// Depth values per metre.
const SCALE: f64 = 1000.0;

/// A depth camera with registered colours.
#[derive(Debug, Clone, Copy)]
pub struct DepthCamera {
    /// Columns and rows.
    pub size: [usize; 2],
    /// Pinhole.
    pub intrinsics: Intrinsics,
    /// Deviation of a depth `z`: `noise[0] + noise[1] (z - 0.4)²`, m (Nguyen et al. 2012).
    pub noise: [f64; 2],
    /// Farthest depth that it gives, m.
    pub farthest: f64,
}

/// What it sees.
pub struct Shot {
    depth: Vec<u16>,
    rgb: Vec<u8>,
    camera: DepthCamera,
}

impl DepthCamera {
    /// Its noise as its maker states it: where it has none, its values are rounded by half a step at most.
    pub(super) fn noise_model(&self) -> NoiseModel {
        let [base, quadratic] = self.noise;
        NoiseModel { base: base.max(0.5 / SCALE), quadratic, nearest: 0.4 }
    }

    pub(super) fn shot(&self, world: &World, pose: &Isometry3<f64>, seed: u64, threads: usize) -> Shot {
        let [width, height] = self.size;
        let (mut depth, mut rgb) = (vec![0; width * height], vec![0; 3 * width * height]);
        let seen = &world.seen_from(Point3::from(pose.translation.vector));
        let rows = height.div_ceil(threads);
        std::thread::scope(|scope| {
            for (part, (depth, rgb)) in depth.chunks_mut(rows * width).zip(rgb.chunks_mut(3 * rows * width)).enumerate()
            {
                scope.spawn(move || {
                    for (row, (depth, rgb)) in depth.chunks_mut(width).zip(rgb.chunks_mut(3 * width)).enumerate() {
                        self.row(world, seen, pose, part * rows + row, seed, depth, rgb);
                    }
                });
            }
        });
        Shot { depth, rgb, camera: *self }
    }

    /// A row has random numbers of its own, so that threads change nothing.
    #[expect(clippy::too_many_arguments, reason = "a row and where it goes")]
    fn row(
        &self,
        world: &World,
        seen: &Seen,
        pose: &Isometry3<f64>,
        v: usize,
        seed: u64,
        depth: &mut [u16],
        rgb: &mut [u8],
    ) {
        let (k, origin) = (&self.intrinsics, Point3::from(pose.translation.vector));
        let mut rng = Rng::new(seed.wrapping_mul(10_007).wrapping_add(v as u64));
        for (u, (depth, rgb)) in depth.iter_mut().zip(rgb.chunks_mut(3)).enumerate() {
            let ray = pose.rotation * Vector3::new((u as f64 - k.cx) / k.fx, (v as f64 - k.cy) / k.fy, 1.0);
            let z = seen.hit(&ray);
            rgb.copy_from_slice(&world.colour(&(origin + ray * z)));
            let noise = if self.noise[0] > 0.0 {
                rng.normal() * (self.noise[0] + self.noise[1] * (z - 0.4).powi(2))
            } else {
                0.0
            };
            *depth = if z < self.farthest { (SCALE * (z + noise)).round().max(0.0) as u16 } else { 0 };
        }
    }
}

impl Shot {
    /// The depth as the map reads it.
    pub fn depth(&self) -> DepthView<'_> {
        let (data, [width, height]) = (DepthData::U16 { data: &self.depth, scale: SCALE }, self.camera.size);
        DepthView { width, height, data, intrinsics: self.camera.intrinsics }
    }

    /// The colours as the map reads them.
    pub fn colour(&self) -> ColourView<'_> {
        let [width, height] = self.camera.size;
        ColourView { width, height, data: ColourData::Rgb8(&self.rgb), intrinsics: self.camera.intrinsics }
    }

    /// Millimetres, row by row.
    pub fn millimetres(&self) -> &[u16] {
        &self.depth
    }

    /// R, G, B, row by row.
    pub fn rgb(&self) -> &[u8] {
        &self.rgb
    }
}
