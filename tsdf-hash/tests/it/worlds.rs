//! Six worlds that a depth camera meets, of boxes, balls and poles, textured from a seed.

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};

use crate::random::Random;
use crate::scene::{Shot, hit_sphere, room};

/// What a world is made of.
#[derive(Clone, Copy)]
enum Solid {
    /// Low and high corner.
    Box([f64; 3], [f64; 3]),
    /// Centre and radius.
    Ball([f64; 3], f64),
    /// Upright (along y): x and z of its axis, radius.
    Pole([f64; 2], f64),
}

/// A world, seen from its origin along z, y down.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum World {
    WallWithBox,
    SphereInRoom,
    Corridor,
    Desk,
    Trees,
    Stairs,
}

impl World {
    pub(crate) const ALL: [Self; 6] =
        [Self::WallWithBox, Self::SphereInRoom, Self::Corridor, Self::Desk, Self::Trees, Self::Stairs];

    fn solids(self) -> Vec<Solid> {
        let wall = |z: f64| Solid::Box([-20.0, -20.0, z], [20.0, 20.0, z + 1.0]);
        let floor = |y: f64| Solid::Box([-20.0, y, -20.0], [20.0, y + 1.0, 20.0]);
        // The inside of a box: six slabs.
        let room = |[x, y, z]: [f64; 3]| {
            [
                wall(z),
                Solid::Box([-20.0, -20.0, -z - 1.0], [20.0, 20.0, -z]),
                Solid::Box([x, -20.0, -20.0], [x + 1.0, 20.0, 20.0]),
                Solid::Box([-x - 1.0, -20.0, -20.0], [-x, 20.0, 20.0]),
                floor(y),
                Solid::Box([-20.0, -y - 1.0, -20.0], [20.0, -y, 20.0]),
            ]
        };
        match self {
            Self::WallWithBox => vec![wall(1.8), Solid::Box([-0.3, -0.25, 1.5], [0.25, 0.3, 1.8])],
            Self::SphereInRoom => {
                room([2.2, 1.5, 2.2]).into_iter().chain([Solid::Ball([0.0, 0.1, 1.3], 0.45)]).collect()
            }
            Self::Corridor => room([0.9, 1.2, 8.0]).into_iter().collect(),
            Self::Desk => vec![
                wall(2.0),
                Solid::Box([-1.5, 0.5, 0.6], [1.5, 0.56, 2.0]),
                Solid::Box([-0.45, 0.05, 1.5], [0.1, 0.5, 1.6]),
                Solid::Ball([0.35, 0.42, 1.1], 0.08),
                Solid::Pole([0.6, 1.5], 0.05),
                Solid::Box([-0.8, 0.4, 0.9], [-0.55, 0.5, 1.2]),
            ],
            Self::Trees => [
                floor(1.3),
                Solid::Pole([0.1, 1.9], 0.15),
                Solid::Pole([-0.9, 2.6], 0.2),
                Solid::Pole([1.0, 2.9], 0.12),
                Solid::Ball([0.3, -1.0, 2.2], 0.6),
                Solid::Ball([-0.9, -1.1, 2.7], 0.7),
                wall(4.0),
            ]
            .to_vec(),
            Self::Stairs => (0..8)
                .map(|k| {
                    let (rise, run) = (0.17 * f64::from(k), 0.28 * f64::from(k));
                    Solid::Box([-1.2, 1.0 - rise, 1.0 + run], [1.2, 5.0, 20.0])
                })
                .chain([Solid::Box([1.2, -20.0, -20.0], [2.0, 20.0, 20.0])])
                .collect(),
        }
    }

    /// An image of 320 x 240 pixels; with noise of the depth camera if there are random numbers.
    pub(crate) fn shot(self, pose: Isometry3<f64>, seed: u64) -> Shot {
        let solids = self.solids();
        let hit = |o: &Point3<f64>, d: &Vector3<f64>| {
            let first = solids.iter().filter_map(|solid| solid.hit(o, d)).fold(f64::INFINITY, f64::min);
            (first < 8.0).then_some(first)
        };
        Shot::take((320, 240), [262.5; 2], pose, hit).painted(|p| room::colour(p, seed as f64))
    }
}

impl Solid {
    fn hit(&self, o: &Point3<f64>, d: &Vector3<f64>) -> Option<f64> {
        match *self {
            Self::Box(low, high) => {
                let slab = |k: usize| {
                    let [a, b] = [(low[k] - o[k]) / d[k], (high[k] - o[k]) / d[k]];
                    [a.min(b), a.max(b)]
                };
                let near = (0..3).map(|k| slab(k)[0]).fold(f64::NEG_INFINITY, f64::max);
                let far = (0..3).map(|k| slab(k)[1]).fold(f64::INFINITY, f64::min);
                (near < far && near > 1e-6).then_some(near)
            }
            Self::Ball(centre, radius) => hit_sphere(radius)(&(o - Vector3::from(centre)), d).filter(|t| *t > 1e-6),
            Self::Pole([x, z], radius) => {
                let (a, b) = (Vector3::new(d.x, 0.0, d.z), Vector3::new(o.x - x, 0.0, o.z - z));
                let (aa, ab, c) = (a.norm_squared(), a.dot(&b), b.norm_squared() - radius * radius);
                let root = ab * ab - aa * c;
                (root >= 0.0).then(|| (-ab - root.sqrt()) / aa).filter(|t| *t > 1e-6)
            }
        }
    }
}

/// Poses of a camera that turns by so many degrees and moves by so many metres from frame to frame, about and along directions of the
/// seed, there and back, so that what it saw first stays in view.
pub(crate) fn shaken(frames: usize, degrees: f64, metres: f64, seed: u64) -> Vec<Isometry3<f64>> {
    let mut random = Random::new(seed);
    let mut direction = || Vector3::from_fn(|_, _| random.uniform() - 0.5).normalize();
    let (axis, along) = (direction(), direction());
    let turn = UnitQuaternion::from_scaled_axis(axis * degrees.to_radians());
    let mut pose = Isometry3::identity();
    let mut poses = vec![pose];
    for k in 1..frames {
        // Two steps there, four back, two there.
        let back = matches!((k - 1) % 8, 2..6);
        let turn = if back { turn.inverse() } else { turn };
        pose.rotation *= turn;
        pose.translation.vector += along * if back { -metres } else { metres };
        poses.push(pose);
    }
    poses
}
