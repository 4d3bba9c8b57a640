//! A furnished room seen by a depth camera: the stream `loop` that `peers/synth_rgbd.py` writes, computed here without its
//! colours, or read from its files.

use std::path::Path;

use nalgebra::{Isometry3, Matrix3, Point3, Quaternion, Rotation3, Translation3, UnitQuaternion, Vector3};
use tsdf_hash::{ColourData, ColourView, DepthData, DepthView, Intrinsics};

/// Columns and rows of an image.
const SIZE: (usize, usize) = (640, 480);
const INTRINSICS: Intrinsics = Intrinsics { fx: 525.0, fy: 525.0, cx: 319.5, cy: 239.5 };
/// Depth values per metre.
const SCALE: f64 = 1000.0;

/// Corners of the room, metres.
const LOW: [f64; 3] = [-3.0, -2.0, 0.0];
const HIGH: [f64; 3] = [3.0, 2.0, 3.0];
/// Centre and radius, metres.
const SPHERES: [[f64; 4]; 4] =
    [[2.1, 1.1, 0.5, 0.5], [-2.2, 1.2, 0.35, 0.35], [-2.3, -1.2, 1.4, 0.4], [0.3, 1.55, 1.8, 0.3]];
/// Lowest and highest corner, metres.
const BOXES: [[f64; 6]; 4] = [
    [1.6, -2.0, 0.0, 2.8, -1.3, 0.75],
    [-3.0, -0.4, 0.0, -2.5, 0.5, 1.9],
    [-0.6, -1.7, 0.0, 0.2, -1.2, 0.45],
    [2.6, -0.3, 0.9, 2.9, 0.5, 1.3],
];

/// A depth image and where it was taken.
pub struct RgbdFrame {
    /// Millimetres along the optical axis, row by row.
    depth: Vec<u16>,
    /// R, G, B; empty without colours.
    rgb: Vec<u8>,
    /// Pose of the camera.
    pub world_from_camera: Isometry3<f64>,
}

impl RgbdFrame {
    /// Image `k` of `n` on the way around the room.
    pub fn take(k: usize, n: usize) -> Self {
        let world_from_camera = pose(k, n);
        let origin = Point3::from(world_from_camera.translation.vector);
        let depth = (0..SIZE.0 * SIZE.1)
            .map(|pixel| (SCALE * first_hit(&origin, &ray(&world_from_camera, pixel))).round() as u16)
            .collect();
        Self { depth, rgb: Vec::new(), world_from_camera }
    }

    /// The colours as the map reads them.
    pub fn colour(&self) -> Option<ColourView<'_>> {
        let data = ColourData::Rgb8(&self.rgb);
        (!self.rgb.is_empty()).then_some(ColourView { width: SIZE.0, height: SIZE.1, data, intrinsics: INTRINSICS })
    }

    /// A check pattern of two colours as large as the image, where only the cost of colours matters.
    #[must_use]
    pub fn painted(mut self) -> Self {
        let check = |k: usize| (k % SIZE.0 / 32 + k / SIZE.0 / 32).is_multiple_of(2);
        self.rgb = (0..SIZE.0 * SIZE.1).flat_map(|k| if check(k) { [200, 40, 30] } else { [40, 60, 190] }).collect();
        self
    }

    /// The camera.
    pub const INTRINSICS: Intrinsics = INTRINSICS;

    /// Depth of every pixel without the rounding to millimetres, metres.
    pub fn exact_depth(&self) -> Vec<f64> {
        let origin = Point3::from(self.world_from_camera.translation.vector);
        (0..SIZE.0 * SIZE.1).map(|pixel| first_hit(&origin, &ray(&self.world_from_camera, pixel))).collect()
    }

    /// The image as the map reads it.
    pub fn view(&self) -> DepthView<'_> {
        let data = DepthData::U16 { data: &self.depth, scale: SCALE };
        DepthView { width: SIZE.0, height: SIZE.1, data, intrinsics: INTRINSICS }
    }
}

/// Direction of a pixel in the world, of length one along the optical axis.
fn ray(world_from_camera: &Isometry3<f64>, pixel: usize) -> Vector3<f64> {
    let x = ((pixel % SIZE.0) as f64 - INTRINSICS.cx) / INTRINSICS.fx;
    let y = ((pixel / SIZE.0) as f64 - INTRINSICS.cy) / INTRINSICS.fy;
    world_from_camera.rotation * Vector3::new(x, y, 1.0)
}

/// The first images of a stream in the files of `synth_rgbd.py`, in its own camera.
pub fn read(folder: &Path, most: usize, coloured: bool) -> Result<Vec<RgbdFrame>, String> {
    let say = |path: &Path, error: &dyn std::fmt::Display| format!("{}: {error}", path.display());
    let poses = folder.join("groundtruth.txt");
    let text = std::fs::read_to_string(&poses).map_err(|e| say(&poses, &e))?;
    let mut frames = Vec::new();
    for (k, line) in text.lines().take(most).enumerate() {
        let row: Vec<f64> = line.split_whitespace().filter_map(|word| word.parse().ok()).collect();
        let &[_, x, y, z, i, j, k_, w] = row.as_slice() else {
            return Err(say(&poses, &format!("line {} is not `t tx ty tz qx qy qz qw`", k + 1)));
        };
        let rotation = UnitQuaternion::from_quaternion(Quaternion::new(w, i, j, k_));
        let path = folder.join(format!("depth/{k:04}.png"));
        let depth = image::open(&path).map_err(|e| say(&path, &e))?.into_luma16();
        let path = folder.join(format!("rgb/{k:04}.png"));
        let rgb =
            if coloured { image::open(&path).map_err(|e| say(&path, &e))?.into_rgb8().into_raw() } else { Vec::new() };
        let pixels = SIZE.0 * SIZE.1;
        if depth.len() != pixels || (coloured && rgb.len() != 3 * pixels) {
            return Err(say(&path, &"the images must be 640 x 480 pixels"));
        }
        let world_from_camera = Isometry3::from_parts(Translation3::new(x, y, z), rotation);
        frames.push(RgbdFrame { depth: depth.into_raw(), rgb, world_from_camera });
    }
    Ok(frames)
}

/// On an ellipse, looking outwards.
fn pose(k: usize, n: usize) -> Isometry3<f64> {
    let angle = std::f64::consts::TAU * k as f64 / n as f64;
    let centre = Vector3::new(0.9 * angle.cos(), 0.5 * angle.sin(), 1.3 + 0.25 * (2.0 * angle).sin());
    let pitch = (-12.0 + 18.0 * (3.0 * angle).sin()).to_radians();
    let forward = Vector3::new(angle.cos() * pitch.cos(), angle.sin() * pitch.cos(), pitch.sin());
    let right = forward.cross(&Vector3::z()).normalize();
    let axes = Matrix3::from_columns(&[right, forward.cross(&right), forward]);
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
    Isometry3::from_parts(Translation3::from(centre), rotation)
}

/// Distance of a point in the air from the nearest surface; exact near surfaces.
pub fn distance(p: &Point3<f64>) -> f64 {
    let walls = (0..3).map(|k| (p[k] - LOW[k]).min(HIGH[k] - p[k]));
    let spheres = SPHERES.iter().map(|s| (p - Point3::new(s[0], s[1], s[2])).norm() - s[3]);
    let boxes = BOXES.iter().map(|b| {
        let half = |k: usize| (b[k + 3] - b[k]) / 2.0;
        let q = Vector3::from([0, 1, 2].map(|k| (p[k] - f64::midpoint(b[k], b[k + 3])).abs() - half(k)));
        q.map(|c| c.max(0.0)).norm() + q.max().min(0.0)
    });
    walls.chain(spheres).chain(boxes).fold(f64::INFINITY, f64::min)
}

/// The `t` at which `o + t d` first meets a surface.
fn first_hit(o: &Point3<f64>, d: &Vector3<f64>) -> f64 {
    let slab = |k: usize, bound: f64| (bound - o[k]) / d[k];
    let wall = (0..3).map(|k| slab(k, if d[k] > 0.0 { HIGH[k] } else { LOW[k] })).fold(f64::INFINITY, f64::min);
    let boxes = BOXES.iter().filter_map(|b| {
        let near = (0..3).map(|k| slab(k, b[k]).min(slab(k, b[k + 3]))).fold(f64::NEG_INFINITY, f64::max);
        let far = (0..3).map(|k| slab(k, b[k]).max(slab(k, b[k + 3]))).fold(f64::INFINITY, f64::min);
        (near < far && near > 1e-6).then_some(near)
    });
    let spheres = SPHERES.iter().filter_map(|s| {
        let to = o - Point3::new(s[0], s[1], s[2]);
        let (a, b, c) = (d.norm_squared(), to.dot(d), to.norm_squared() - s[3] * s[3]);
        let root = b * b - a * c;
        (root > 0.0).then(|| (-b - root.sqrt()) / a).filter(|t| *t > 1e-6)
    });
    boxes.chain(spheres).fold(wall, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Millimetres at some pixels and the sum over all, from the files of `synth_rgbd.py loop --preset loop`.
    #[test]
    fn is_the_stream_of_the_peers() {
        let images = [
            (0, [(0, 0, 1957), (320, 240, 1738), (639, 479, 1987), (100, 400, 2296), (560, 60, 2001)], 626_864_312),
            (7, [(0, 0, 1504), (320, 240, 2494), (639, 479, 2001), (100, 400, 1685), (560, 60, 2247)], 661_483_120),
        ];
        for (k, pixels, sum) in images {
            let frame = RgbdFrame::take(k, 60);
            for (u, v, expected) in pixels {
                assert_eq!(frame.depth[v * SIZE.0 + u], expected, "image {k}, pixel {u}, {v}");
            }
            // Another libm may round a handful of pixels the other way.
            let found: i64 = frame.depth.iter().copied().map(i64::from).sum();
            assert!((found - sum).abs() < 10, "image {k}: {found}");
        }
    }
}
