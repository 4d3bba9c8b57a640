//! The tracker against poses that are known.

use nalgebra::{Isometry3, Matrix6, Point3, UnitQuaternion, Vector3, Vector6};
use tsdf_hash::tracking::{PosePrior, Tracker, TrackingOutcome, TrackingSettings, TrackingStatus};
use tsdf_hash::{ColourData, ColourView, Map, NoiseModel, Settings};

use crate::random::Random;
use crate::scene::{Shot, look_at, room};

const FREE: NoiseModel = NoiseModel { base: 0.0012, quadratic: 0.0019, nearest: 0.4 };

fn prior(world_from_camera: Isometry3<f64>) -> PosePrior {
    PosePrior { world_from_camera, covariance: None }
}

/// Metres and radians between two poses.
fn apart(a: &Isometry3<f64>, b: &Isometry3<f64>) -> (f64, f64) {
    ((a.translation.vector - b.translation.vector).norm(), (a.rotation.inverse() * b.rotation).angle())
}

fn tracker() -> Tracker {
    Tracker::new(TrackingSettings::default()).unwrap()
}

fn map_of(shots: &[Shot], voxel_size: f64) -> Map {
    let mut map = Map::new(Settings { voxel_size, ..Settings::default() }).unwrap();
    for shot in shots {
        map.integrate(&shot.view(), None, &shot.world_from_camera).unwrap();
    }
    map
}

/// Noise of the model on every pixel: a sum of four uniform numbers of unit variance.
pub(crate) fn noisy(shot: &Shot, random: &mut Random) -> Vec<f32> {
    let noise = |z: f64, random: &mut Random| {
        let sum: f64 = (0..4).map(|_| random.uniform()).sum();
        3.0_f64.sqrt() * (sum - 2.0) * (FREE.base + FREE.quadratic * (z - FREE.nearest).powi(2))
    };
    shot.depth.iter().map(|&z| z + noise(f64::from(z), random) as f32).collect()
}

#[test]
fn a_room_is_followed_without_poses() {
    // A degree and a centimetre per image, from the depth alone, with no word about the motion but the last two poses.
    let poses: Vec<_> = (0..30).map(|k| room::pose(k, 360)).collect();
    let shots: Vec<_> =
        poses.iter().map(|&pose| Shot::take((320, 240), [262.5; 2], pose, |o, d| Some(room::hit(o, d)))).collect();
    let mut map = map_of(&shots[..1], 0.02);
    let mut tracker = tracker();
    let (mut before, mut last) = (poses[0], poses[0]);
    for shot in &shots[1..] {
        let guess = last * (before.inverse() * last);
        let outcome = tracker.track(&mut map, &shot.view(), None, &prior(guess)).unwrap();
        // A ball before a wall leaves the turn about its axis along the wall's normal open, where nothing else is in view.
        let is_turn = |direction: &Vector6<f64>| direction[0].abs() > 0.5 && direction[1].hypot(direction[2]) < 0.05;
        assert!(outcome.is_tracked() || outcome.status == TrackingStatus::Degenerate, "{outcome:?}");
        assert!(outcome.degenerate.len() <= 1 && outcome.degenerate.iter().all(is_turn), "{outcome:?}");
        (before, last) = (last, outcome.world_from_camera);
        map.integrate(&shot.view(), None, &last).unwrap();
        let (metres, radians) = apart(&last, &shot.world_from_camera);
        assert!(metres < 10e-3 && radians < 5e-3, "{metres} m, {radians} rad");
    }
}

#[test]
fn a_wrong_prior_is_corrected() {
    // Odometry wrong by 2 degrees and 3 cm, in any direction.
    let shots = room::tour(60, 2, &Isometry3::identity());
    let mut map = map_of(&shots[..12], 0.02);
    let (mut tracker, mut random) = (tracker(), Random::new(3));
    for shot in &shots[3..10] {
        let mut direction = || Vector3::from_fn(|_, _| random.uniform() - 0.5).normalize();
        let turn = UnitQuaternion::from_scaled_axis(direction() * 2.0_f64.to_radians());
        let wrong = Isometry3::from_parts(
            (shot.world_from_camera.translation.vector + direction() * 0.03).into(),
            turn * shot.world_from_camera.rotation,
        );
        let outcome = tracker.track(&mut map, &shot.view(), None, &prior(wrong)).unwrap();
        let (metres, radians) = apart(&outcome.world_from_camera, &shot.world_from_camera);
        assert!(outcome.is_tracked() && metres < 2e-3 && radians < 1e-3, "{metres} m, {radians} rad");
    }
}

#[test]
fn a_wall_alone_is_degenerate() {
    // Two shifts along the wall and the turn about its normal cannot be seen; the rest can.
    let pose = look_at(Point3::new(0.0, 0.0, 0.0), Point3::new(1.0, 0.3, 0.2));
    let wall = |o: &Point3<f64>, d: &Vector3<f64>| Some((1.5 - o.x) / d.x);
    let shot = Shot::take((320, 240), [262.5; 2], pose, wall);
    let mut random = Random::new(5);
    let mut map = Map::new(Settings { voxel_size: 0.02, ..Settings::default() }).unwrap();
    for _ in 0..5 {
        let depth = noisy(&shot, &mut random);
        map.integrate(&Shot { depth, ..shot.clone() }.view(), None, &pose).unwrap();
    }
    let shift = Vector3::new(0.02, 0.03, -0.04);
    let off = Isometry3::from_parts((pose.translation.vector + shift).into(), pose.rotation);
    let seen = Shot { depth: noisy(&shot, &mut random), ..shot.clone() };
    let known = PosePrior { world_from_camera: off, covariance: Some(Matrix6::identity()) };
    let outcome = tracker().track(&mut map, &seen.view(), None, &known).unwrap();
    assert!(outcome.is_tracked());
    assert_eq!(outcome.degenerate.len(), 3, "{:?}", outcome.degenerate);
    for direction in &outcome.degenerate {
        // No shift along the normal, no turn but about it.
        assert!(direction[3].abs() < 0.05 && direction[1].hypot(direction[2]) < 0.05, "{direction}");
    }
    let left = outcome.world_from_camera.translation.vector - pose.translation.vector;
    assert!(left.x.abs() < 1e-3, "the distance is corrected: {left}");
    assert!((left.y - 0.03).abs() < 3e-3 && (left.z + 0.04).abs() < 3e-3, "the prior is kept: {left}");
    // And the covariance says so.
    let deviation = |k: usize| outcome.covariance[(k, k)].sqrt();
    assert!(deviation(3) < 0.1 && deviation(4) > 0.5 && deviation(5) > 0.5, "{}", outcome.covariance);
}

#[test]
fn texture_fixes_what_a_wall_does_not() {
    let pose = look_at(Point3::new(0.0, 0.0, 0.0), Point3::new(1.0, 0.3, 0.2));
    let wall = |o: &Point3<f64>, d: &Vector3<f64>| Some((1.5 - o.x) / d.x);
    // Waves along both axes of the wall.
    let picture = |shot: &Shot| -> Vec<u8> {
        let k = shot.intrinsics;
        let pixel = |at: usize| {
            let (u, v, z) = ((at % shot.width) as f64, (at / shot.width) as f64, f64::from(shot.depth[at]));
            let p = shot.world_from_camera * Point3::new((u - k.cx) / k.fx * z, (v - k.cy) / k.fy * z, z);
            let grey = 128.0 + 60.0 * (20.0 * p.y + 1.0).sin() + 50.0 * (17.0 * p.z + 4.0 * p.y).sin();
            [grey.clamp(0.0, 255.0) as u8; 3]
        };
        (0..shot.depth.len()).flat_map(pixel).collect()
    };
    let shot = Shot::take((320, 240), [262.5; 2], pose, wall);
    let rgb = picture(&shot);
    let colour =
        |data| ColourView { width: 320, height: 240, data: ColourData::Rgb8(data), intrinsics: shot.intrinsics };
    let mut map = Map::new(Settings { voxel_size: 0.01, ..Settings::default() }).unwrap();
    map.integrate(&shot.view(), Some(&colour(&rgb)), &pose).unwrap();
    let shift = Vector3::new(0.005, 0.008, -0.006);
    let off = |by: f64| Isometry3::from_parts((pose.translation.vector + by * shift).into(), pose.rotation);
    // Near, and so far that no intensity agrees at first: the wall, exact as it is, must not drown what they say.
    for by in [1.0, 6.0] {
        let outcome = tracker().track(&mut map, &shot.view(), Some(&colour(&rgb)), &prior(off(by))).unwrap();
        let (metres, radians) = apart(&outcome.world_from_camera, &pose);
        assert!(outcome.is_tracked() && outcome.degenerate.is_empty(), "{outcome:?}");
        assert!(metres < 1e-3 && radians < 1e-3, "{metres} m, {radians} rad");
    }
    // A lamp that was turned up changes nothing.
    let bright: Vec<u8> = rgb.iter().map(|c| c.saturating_add(20)).collect();
    let brighter = tracker().track(&mut map, &shot.view(), Some(&colour(&bright)), &prior(off(1.0))).unwrap();
    let (metres, _) = apart(&brighter.world_from_camera, &pose);
    assert!(brighter.is_tracked() && metres < 1.5e-3, "{metres} m");
}

#[test]
fn what_has_no_depth_is_followed_by_its_colour() {
    // A wall of which the frame has the depth of one side only, where it is of one grey.
    let pose = look_at(Point3::new(0.0, 0.0, 0.0), Point3::new(1.0, 0.3, 0.2));
    let wall = |o: &Point3<f64>, d: &Vector3<f64>| Some((1.5 - o.x) / d.x);
    let whole = Shot::take((320, 240), [262.5; 2], pose, wall);
    let left_of = |column: usize| {
        let depth = whole.depth.iter().enumerate().map(|(at, &z)| if at % 320 < column { z } else { 0.0 });
        Shot { depth: depth.collect(), ..whole.clone() }
    };
    let edge = whole.world_from_camera * Point3::new((80.0 - 159.5) / 262.5 * 1.5, 0.0, 1.5);
    let painted = whole.clone().painted(|p| {
        let waves = 60.0 * (20.0 * p.y + 1.0).sin() + 50.0 * (17.0 * p.z + 4.0 * p.y).sin();
        [if p.y > edge.y { 128 } else { (128.0 + waves) as u8 }; 3]
    });
    let mut map = Map::new(Settings { voxel_size: 0.01, ..Settings::default() }).unwrap();
    map.integrate(&whole.view(), painted.colour().as_ref(), &pose).unwrap();
    let shift = Vector3::new(0.005, 0.008, -0.006);
    let off = Isometry3::from_parts((pose.translation.vector + shift).into(), pose.rotation);
    let mut track = |columns: usize, colour: bool| {
        let colour = painted.colour().filter(|_| colour);
        tracker().track(&mut map, &left_of(columns).view(), colour.as_ref(), &prior(off)).unwrap()
    };
    let outcome = track(80, true);
    let (metres, radians) = apart(&outcome.world_from_camera, &pose);
    assert!(outcome.is_tracked() && outcome.degenerate.is_empty(), "{outcome:?}");
    assert!(metres < 1e-3 && radians < 1e-3, "{metres} m, {radians} rad");
    // Nothing holds a quarter of a wall without colour, and colour holds nothing that hardly any depth bears out.
    assert_eq!(track(80, false).status, TrackingStatus::NoOverlap);
    assert_eq!(track(20, true).status, TrackingStatus::NoOverlap);
}

#[test]
fn a_camera_that_is_lost_says_so() {
    let shots = room::tour(60, 2, &Isometry3::identity());
    let mut map = map_of(&shots[..5], 0.02);
    let mut tracker = tracker();
    // The other side of the room, where nothing was mapped; and an image from there, believed to be here.
    let unseen = tracker.track(&mut map, &shots[35].view(), None, &prior(shots[35].world_from_camera)).unwrap();
    assert_eq!(unseen.status, TrackingStatus::NoOverlap);
    let elsewhere = tracker.track(&mut map, &shots[35].view(), None, &prior(shots[2].world_from_camera)).unwrap();
    assert!(!elsewhere.is_tracked(), "{elsewhere:?}");
    assert_eq!(elsewhere.world_from_camera, shots[2].world_from_camera);
    // A jump against a prior that knows better.
    let mut away = shots[2].world_from_camera;
    away.translation.vector.x += 0.03;
    let sure = PosePrior { world_from_camera: away, covariance: Some(Matrix6::identity() * 1e-8) };
    let jump = tracker.track(&mut map, &shots[2].view(), None, &sure).unwrap();
    assert!(!jump.is_tracked(), "{jump:?}");
}

#[test]
fn threads_leave_no_trace() {
    let shots = room::tour(60, 4, &Isometry3::identity());
    let mut map = map_of(&shots[..4], 0.02);
    let track = |map: &mut Map, threads: usize| -> TrackingOutcome {
        let settings = TrackingSettings { threads, ..TrackingSettings::default() };
        let mut tracker = Tracker::new(settings).unwrap();
        tracker.track(map, &shots[2].view(), None, &prior(shots[3].world_from_camera)).unwrap()
    };
    let (one, three) = (track(&mut map, 1), track(&mut map, 3));
    assert_eq!(one.world_from_camera, three.world_from_camera);
    assert_eq!(one.covariance, three.covariance);
}
