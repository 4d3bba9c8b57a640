//! Scenes with a known distance and a known first hit, and a camera that looks at them.

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use tsdf_hash::{ColourData, ColourView, DepthData, DepthView, Intrinsics};

/// A depth image in metres with the camera it was taken by; 0 where the ray hits nothing.
#[derive(Clone)]
pub(crate) struct Shot {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) depth: Vec<f32>,
    pub(crate) intrinsics: Intrinsics,
    pub(crate) world_from_camera: Isometry3<f64>,
    /// R, G, B of each pixel; empty in the dark.
    pub(crate) rgb: Vec<u8>,
}

impl Shot {
    /// `hit(origin, direction)` returns the first `t` with `origin + t direction` on a surface.
    pub(crate) fn take(
        (width, height): (usize, usize),
        focal: [f64; 2],
        world_from_camera: Isometry3<f64>,
        hit: impl Fn(&Point3<f64>, &Vector3<f64>) -> Option<f64>,
    ) -> Self {
        let (cx, cy) = ((width - 1) as f64 / 2.0, (height - 1) as f64 / 2.0);
        let intrinsics = Intrinsics { fx: focal[0], fy: focal[1], cx, cy };
        let origin = Point3::from(world_from_camera.translation.vector);
        let depth = (0..width * height)
            .map(|k| {
                let ray = [((k % width) as f64 - cx) / focal[0], ((k / width) as f64 - cy) / focal[1]];
                hit(&origin, &(world_from_camera.rotation * Vector3::new(ray[0], ray[1], 1.0))).unwrap_or(0.0) as f32
            })
            .collect();
        Self { width, height, depth, intrinsics, world_from_camera, rgb: Vec::new() }
    }

    pub(crate) fn view(&self) -> DepthView<'_> {
        let data = DepthData::F32 { data: &self.depth };
        DepthView { width: self.width, height: self.height, data, intrinsics: self.intrinsics }
    }

    /// Paints what is seen; `colour` is asked with points of the world.
    pub(crate) fn painted(mut self, colour: impl Fn(&Point3<f64>) -> [u8; 3]) -> Self {
        let k = self.intrinsics;
        let pixel = |at: usize| {
            let (u, v, z) = ((at % self.width) as f64, (at / self.width) as f64, f64::from(self.depth[at]));
            colour(&(self.world_from_camera * Point3::new((u - k.cx) / k.fx * z, (v - k.cy) / k.fy * z, z)))
        };
        self.rgb = (0..self.depth.len()).flat_map(pixel).collect();
        self
    }

    pub(crate) fn colour(&self) -> Option<ColourView<'_>> {
        let data = ColourData::Rgb8(&self.rgb);
        let view = ColourView { width: self.width, height: self.height, data, intrinsics: self.intrinsics };
        (!self.rgb.is_empty()).then_some(view)
    }
}

/// A camera at `eye` that looks at `target`, z forward and y roughly down.
pub(crate) fn look_at(eye: Point3<f64>, target: Point3<f64>) -> Isometry3<f64> {
    let forward = (target - eye).normalize();
    let up = if forward.z.abs() > 0.9 { Vector3::y() } else { Vector3::z() };
    let right = forward.cross(&up).normalize();
    let rotation = Matrix3::from_columns(&[right, forward.cross(&right), forward]);
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation));
    Isometry3::from_parts(Translation3::from(eye.coords), rotation)
}

pub(crate) fn hit_sphere(radius: f64) -> impl Fn(&Point3<f64>, &Vector3<f64>) -> Option<f64> {
    move |o, d| {
        let (a, b, c) = (d.norm_squared(), o.coords.dot(d), o.coords.norm_squared() - radius * radius);
        let root = b * b - a * c;
        (root >= 0.0).then(|| (-b - root.sqrt()) / a).filter(|t| *t > 0.0)
    }
}

/// A furnished room: the inside of a box, with four spheres and four boxes in it.
pub(crate) mod room {
    use super::{Isometry3, Matrix3, Point3, Rotation3, Shot, Translation3, UnitQuaternion, Vector3};

    const LOW: [f64; 3] = [-3.0, -2.0, 0.0];
    const HIGH: [f64; 3] = [3.0, 2.0, 3.0];
    const SPHERES: [[f64; 4]; 4] =
        [[2.1, 1.1, 0.5, 0.5], [-2.2, 1.2, 0.35, 0.35], [-2.3, -1.2, 1.4, 0.4], [0.3, 1.55, 1.8, 0.3]];
    const BOXES: [[f64; 6]; 4] = [
        [1.6, -2.0, 0.0, 2.8, -1.3, 0.75],
        [-3.0, -0.4, 0.0, -2.5, 0.5, 1.9],
        [-0.6, -1.7, 0.0, 0.2, -1.2, 0.45],
        [2.6, -0.3, 0.9, 2.9, 0.5, 1.3],
    ];

    /// Distance from the nearest surface, positive in the air; exact near surfaces.
    pub(crate) fn sdf(p: &Point3<f64>) -> f64 {
        let mut r = (0..3).map(|k| (p[k] - LOW[k]).min(HIGH[k] - p[k])).fold(f64::INFINITY, f64::min);
        for s in SPHERES {
            r = r.min((p - Point3::new(s[0], s[1], s[2])).norm() - s[3]);
        }
        for b in BOXES {
            let q = Vector3::from(
                [0, 1, 2].map(|k| (p[k] - f64::midpoint(b[k], b[k + 3])).abs() - (b[k + 3] - b[k]) / 2.0),
            );
            r = r.min(q.map(|c| c.max(0.0)).norm() + q.max().min(0.0));
        }
        r
    }

    pub(crate) fn hit(o: &Point3<f64>, d: &Vector3<f64>) -> f64 {
        let slab = |k: usize, bound: f64| (bound - o[k]) / d[k];
        let mut t = (0..3).map(|k| slab(k, if d[k] > 0.0 { HIGH[k] } else { LOW[k] })).fold(f64::INFINITY, f64::min);
        for b in BOXES {
            let near = (0..3).map(|k| slab(k, b[k]).min(slab(k, b[k + 3]))).fold(f64::NEG_INFINITY, f64::max);
            let far = (0..3).map(|k| slab(k, b[k]).max(slab(k, b[k + 3]))).fold(f64::INFINITY, f64::min);
            if near < far && near > 1e-6 {
                t = t.min(near);
            }
        }
        for s in SPHERES {
            let to = Point3::from(o - Point3::new(s[0], s[1], s[2]));
            t = super::hit_sphere(s[3])(&to, d).filter(|s| *s > 1e-6).map_or(t, |s| t.min(s));
        }
        t
    }

    /// Plaster and posters: patches of 25 cm and grain of 6 cm, of some greys; `seed` makes another room of it.
    pub(crate) fn colour(p: &Point3<f64>, seed: f64) -> [u8; 3] {
        let grain = |cell: f64| {
            let [x, y, z] = [0, 1, 2].map(|k| p[k] / cell + seed * [0.37, 0.61, 0.83][k]);
            let corner = |dx: f64, dy: f64, dz: f64| {
                let at = (x.floor() + dx) * 12.9898 + (y.floor() + dy) * 78.233 + (z.floor() + dz) * 37.719;
                let value = (at.sin() * 43758.5453).rem_euclid(1.0);
                let weight = |t: f64, d: f64| if d > 0.0 { t - t.floor() } else { 1.0 - (t - t.floor()) };
                value * weight(x, dx) * weight(y, dy) * weight(z, dz)
            };
            let corners = [0.0, 1.0];
            corners
                .iter()
                .flat_map(|a| corners.map(|b| (*a, b)))
                .map(|(a, b)| corner(a, b, 0.0) + corner(a, b, 1.0))
                .sum::<f64>()
        };
        let grey = 40.0 + 110.0 * grain(0.25) + 70.0 * grain(0.06);
        [grey as u8, (0.9 * grey) as u8, (0.8 * grey) as u8]
    }

    /// Pose `k` of `n` on an ellipse, looking outward.
    pub(crate) fn pose(k: usize, n: usize) -> Isometry3<f64> {
        let th = std::f64::consts::TAU * k as f64 / n as f64;
        let centre = Vector3::new(0.9 * th.cos(), 0.5 * th.sin(), 1.3 + 0.25 * (2.0 * th).sin());
        let pitch = (-12.0 + 18.0 * (3.0 * th).sin()).to_radians();
        let forward = Vector3::new(th.cos() * pitch.cos(), th.sin() * pitch.cos(), pitch.sin());
        let right = forward.cross(&Vector3::z()).normalize();
        let rotation = Matrix3::from_columns(&[right, forward.cross(&right), forward]);
        let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation));
        Isometry3::from_parts(Translation3::from(centre), rotation)
    }

    /// `n` images around the room, a `1 / shrink` of 640 x 480 at a focal length of 525, the world moved by `moved`.
    pub(crate) fn tour(n: usize, shrink: usize, moved: &Isometry3<f64>) -> Vec<Shot> {
        let size = (640 / shrink, 480 / shrink);
        (0..n)
            .map(|k| {
                let mut shot = Shot::take(size, [525.0 / shrink as f64; 2], pose(k, n), |o, d| Some(hit(o, d)));
                shot.world_from_camera = moved * shot.world_from_camera;
                shot
            })
            .collect()
    }

    /// Values of an independent implementation in Python: distances at five points, and depths of the first image.
    #[test]
    fn agrees_with_its_reference() {
        for (p, expected) in [
            ([0.0, 0.0, 1.5], 1.307015868),
            ([2.1, 1.1, 1.2], 0.2),
            ([2.2, -1.5, 0.9], 0.15),
            ([-2.4, 0.0, 1.0], 0.1),
            ([2.75, 0.1, 0.8], 0.1),
        ] {
            assert!((sdf(&Point3::from(p)) - expected).abs() < 1e-9);
        }
        let shot = Shot::take((640, 480), [525.0; 2], pose(0, 60), |o, d| Some(hit(o, d)));
        for ((u, v), expected) in [
            ((0, 0), 1.957139),
            ((320, 240), 1.738331),
            ((639, 479), 1.987362),
            ((100, 400), 2.296121),
            ((560, 60), 2.001461_f32),
        ] {
            assert!((shot.depth[v * 640 + u] - expected).abs() < 1e-6);
        }
    }
}
