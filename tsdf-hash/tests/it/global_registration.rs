//! A camera finds itself by shape alone on a surveyed wall, and not on another one, nor where the shape fixes no place.

use std::f64::consts::TAU;

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use tsdf_hash::Error;
use tsdf_hash::global_registration::*;

use crate::noisy_room::apart;
use crate::random::Random;
use crate::scene::{Shot, look_at};
use crate::tracking::noisy;

/// Half the width and half the height of a wall, m.
const HALF: [f64; 2] = [2.2, 1.1];

/// A wall about x = 0 that is seen from smaller x, with a relief.
struct Wall<'a>(&'a dyn Fn(f64, f64) -> f64);

impl Wall<'_> {
    fn mesh(&self) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
        let (columns, rows, step) = (88, 44, 0.05);
        let at = |k: u32| {
            let (y, z) = (f64::from(k % (columns + 1)) * step - HALF[0], f64::from(k / (columns + 1)) * step - HALF[1]);
            [-(self.0)(y, z), y, z].map(|c| c as f32)
        };
        let mut faces = Vec::new();
        for row in 0..rows {
            for column in 0..columns {
                let a = row * (columns + 1) + column;
                let [b, c, d] = [a + 1, a + columns + 2, a + columns + 1];
                faces.extend([[a, c, b], [a, d, c]]);
            }
        }
        ((0..(columns + 1) * (rows + 1)).map(at).collect(), faces)
    }

    /// The first point along a ray at which it is behind the relief, by bisection.
    fn hit(&self, o: &Point3<f64>, d: &Vector3<f64>) -> Option<f64> {
        let behind = |t: f64| {
            let p = o + d * t;
            p.x + (self.0)(p.y, p.z)
        };
        let first = (1..100).map(|k| 0.04 * f64::from(k)).find(|t| behind(*t) > 0.0)?;
        let (mut low, mut high) = (first - 0.04, first);
        for _ in 0..20 {
            let middle = f64::midpoint(low, high);
            if behind(middle) > 0.0 { high = middle } else { low = middle }
        }
        let p = o + d * high;
        (p.y.abs() <= HALF[0] && p.z.abs() <= HALF[1]).then_some(high)
    }

    fn shot(&self, pose: Isometry3<f64>, random: &mut Random) -> Shot {
        let clean = Shot::take((120, 90), [82.0; 2], pose, |o, d| self.hit(o, d));
        let depth =
            noisy(&clean, random).iter().zip(&clean.depth).map(|(n, c)| if *c > 0.0 { *n } else { 0.0 }).collect();
        Shot { depth, ..clean }
    }

    /// What a camera sees from a pose and from two beside it, in the frame of the first camera; the odometry between them errs by 2 mm.
    fn cloud(&self, pose: &Isometry3<f64>, random: &mut Random) -> LocalCloud {
        let mut cloud = LocalCloud::new(GlobalRegistrationSettings::default().spacing);
        for aside in [0.0_f64, 0.1, -0.1] {
            let moved = Isometry3::new(Vector3::new(aside, 0.5 * aside, 0.0), Vector3::new(0.0, 0.5 * aside, 0.0));
            let error = Isometry3::translation(0.002 * aside.signum() * f64::from(u8::from(aside != 0.0)), 0.0, 0.0);
            cloud.add(&self.shot(pose * moved, random).view(), &(moved * error), 4.0).unwrap();
        }
        cloud
    }
}

/// Bulges of three sizes with random places.
fn rough(seed: u64) -> impl Fn(f64, f64) -> f64 {
    let mut random = Random::new(seed);
    let waves: Vec<[f64; 4]> = [(1.6_f64, 0.10), (1.1, 0.06), (0.7, 0.03), (0.5, 0.015)]
        .into_iter()
        .flat_map(|(length, height)| [(length, height); 2])
        .map(|(length, height)| {
            let (course, phase) = (TAU * random.uniform(), TAU * random.uniform());
            let turn = TAU / length;
            [turn * course.cos(), turn * course.sin(), phase, height]
        })
        .collect();
    move |y, z| waves.iter().map(|[a, b, phase, height]| height * (a * y + b * z + phase).sin()).sum()
}

fn place(random: &mut Random) -> Isometry3<f64> {
    let mut off = |most: f64| most * (2.0 * random.uniform() - 1.0);
    let eye = Point3::new(-1.3 + off(0.4), off(1.0), off(0.3));
    let target = Point3::new(0.0, eye.y + off(0.5), eye.z + off(0.2));
    look_at(eye, target) * UnitQuaternion::from_axis_angle(&Vector3::z_axis(), off(0.1))
}

/// Up in the camera's frame, half a degree off.
fn up(pose: &Isometry3<f64>) -> Vector3<f64> {
    UnitQuaternion::from_axis_angle(&Vector3::x_axis(), 0.009) * (pose.rotation.inverse() * Vector3::z())
}

fn registration(wall: &Wall) -> GlobalRegistration {
    let (positions, faces) = wall.mesh();
    GlobalRegistration::new(&positions, &faces, GlobalRegistrationSettings::default()).unwrap()
}

#[test]
fn a_camera_is_found_on_its_own_wall_and_on_no_other() {
    let (own, other) = (rough(1), rough(2));
    let surface = registration(&Wall(&own));
    let mut random = Random::new(5);
    let (mut found, mut wrong) = (0, 0);
    for _ in 0..3 {
        let pose = place(&mut random);
        let places = surface.register(&Wall(&own).cloud(&pose, &mut random), &up(&pose));
        if let [place] = &places[..] {
            let (shift, turn) = apart(&place.world_from_local, &pose);
            println!("{shift:.4} m, {turn:.4} rad, {place:?}");
            assert!(shift < 0.02 && turn < 0.02, "{shift} m, {turn} rad");
            found += 1;
        }
        wrong += surface.register(&Wall(&other).cloud(&pose, &mut random), &up(&pose)).len();
    }
    assert!(found == 3 && wrong == 0, "{found} found, {wrong} places on another wall");
}

/// A flat wall and one that is the same along its height fix no place; one that repeats itself has several.
#[test]
fn what_does_not_fix_a_place_is_not_one() {
    let mut random = Random::new(6);
    let pose = look_at(Point3::new(-1.2, 0.1, 0.0), Point3::new(0.0, 0.15, 0.05));
    let flutes = |y: f64, _: f64| 0.08 * (4.0 * y).sin() + 0.05 * (2.3 * y).sin();
    let tiles = |y: f64, z: f64| 0.05 * (TAU * y / 0.7).sin() * (TAU * z / 0.7).sin();
    for (relief, places) in
        [(&(|_: f64, _: f64| 0.0) as &dyn Fn(f64, f64) -> f64, 0..=0), (&flutes, 0..=0), (&tiles, 2..=24)]
    {
        let wall = Wall(relief);
        let found = registration(&wall).register(&wall.cloud(&pose, &mut random), &up(&pose));
        assert!(places.contains(&found.len()), "{found:?}");
    }
}

#[test]
fn surfaces_and_settings_that_make_no_sense_are_refused() {
    let usual = GlobalRegistrationSettings::default();
    let (positions, faces) = Wall(&rough(1)).mesh();
    for bad in [
        GlobalRegistrationSettings { spacing: 0.0, ..usual },
        GlobalRegistrationSettings { spacing: 1e-3, ..usual },
        GlobalRegistrationSettings { up: Vector3::zeros(), ..usual },
        GlobalRegistrationSettings { bases: 0, ..usual },
        GlobalRegistrationSettings { least_share: 1.5, ..usual },
        GlobalRegistrationSettings { ambiguity: f64::NAN, ..usual },
    ] {
        let large = positions.iter().map(|p| p.map(|c| 10.0 * c)).collect::<Vec<_>>();
        assert!(matches!(GlobalRegistration::new(&large, &faces, bad), Err(Error::InvalidSetting { .. })), "{bad:?}");
    }
    assert!(GlobalRegistration::new(&positions, &[[0, 1, 99_999]], usual).is_err());
    let nothing = GlobalRegistration::new(&[[f32::NAN; 3]; 3], &[[0, 1, 2]], usual).unwrap();
    let pose = place(&mut Random::new(1));
    let cloud = Wall(&rough(1)).cloud(&pose, &mut Random::new(1));
    assert!(nothing.register(&cloud, &up(&pose)).is_empty());
    assert!(registration(&Wall(&rough(1))).register(&LocalCloud::new(0.04), &Vector3::z()).is_empty());
    assert!(registration(&Wall(&rough(1))).register(&cloud, &Vector3::zeros()).is_empty());
}
