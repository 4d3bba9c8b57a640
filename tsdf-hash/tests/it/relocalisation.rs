//! A lost camera is found in the room that was mapped, and not in another one.

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use tsdf_hash::place_recognition::KeyframeIndex;
use tsdf_hash::tracking::{Relocaliser, TrackingSettings};
use tsdf_hash::{Map, Settings};

use crate::noisy_room::{apart, seen, unit};
use crate::random::Random;
use crate::scene::{Shot, look_at, room};
use crate::tracking::noisy;

/// Frames that a lost camera may take until it is found.
const FRAMES: usize = 12;
/// Metres and radians beside the tour that a search begins at most.
const BESIDE: [f64; 2] = [0.1, 0.15];
/// Right: within so many metres, and radians.
const RIGHT: [f64; 2] = [5e-3, 0.3 * std::f64::consts::PI / 180.0];

/// What a search came to.
#[derive(Debug, Default)]
struct Tally {
    right: usize,
    wrong: usize,
    nowhere: usize,
    elsewhere: usize,
    frames: usize,
    /// Processor time of the searches inside and elsewhere, seconds, and their frames.
    cost: [(f64, usize); 2],
    worst: [f64; 2],
}

/// A painted room, or one in the dark.
fn lit(shot: Shot, light: bool, seed: f64) -> Shot {
    if light { shot.painted(|p| room::colour(p, seed)) } else { shot }
}

/// The map of a tour with noisy depth, and its keyframes.
pub(crate) fn mapped(random: &mut Random, light: bool) -> (Map, KeyframeIndex) {
    rooms(1, random, light)
}

/// The same of so many rooms in a row that look the same.
fn rooms(count: usize, random: &mut Random, light: bool) -> (Map, KeyframeIndex) {
    let settings = Settings { voxel_size: 0.02, threads: 2, ..Settings::default() };
    let (mut map, mut keyframes) = (Map::new(settings).unwrap(), KeyframeIndex::new());
    for room in 0..count {
        let there = Isometry3::translation(10.0 * room as f64, 0.0, 0.0);
        for k in 0..120 {
            let shot = lit(seen(room::pose(k, 120), random), light, 0.0);
            let pose = there * shot.world_from_camera;
            map.integrate(&shot.view(), shot.colour().as_ref(), &pose).unwrap();
            keyframes.add(&shot.view(), shot.colour().as_ref(), &pose).unwrap();
        }
    }
    (map, keyframes)
}

/// Another room: larger, with another corner up.
fn other_room(pose: Isometry3<f64>) -> Shot {
    let turned = |v: &Vector3<f64>| Vector3::new(v.z, v.x, v.y);
    Shot::take((320, 240), [262.5; 2], pose, |o, d| {
        let inside = Point3::from(turned(&o.coords) * 0.7 + Vector3::new(-0.6, 0.3, 0.9));
        Some(room::hit(&inside, &(turned(d) * 0.7)))
    })
}

/// Sweeps of a lost camera, up to 10 cm and 9 degrees beside the tour and onwards at 2.4 degrees and a few centimetres a frame.
fn sweeps(inside: usize, elsewhere: usize, light: bool) -> Tally {
    let mut random = Random::new(31);
    let (mut map, keyframes) = mapped(&mut random, light);
    let mut relocaliser = Relocaliser::new(TrackingSettings { threads: 2, ..TrackingSettings::default() }).unwrap();
    let mut tally = Tally::default();
    for n in 0..inside + elsewhere {
        let is_inside = n < inside;
        let first = (360.0 * random.uniform()) as usize;
        let aside = Isometry3::new(
            unit(&mut random) * BESIDE[0] * random.uniform(),
            unit(&mut random) * BESIDE[1] * random.uniform(),
        );
        relocaliser.reset();
        let mut found = None;
        for k in 0..FRAMES {
            let truth = room::pose(2 * first + 5 * k, 720) * aside;
            let shot = if is_inside {
                lit(seen(truth, &mut random), light, 0.0)
            } else {
                let clean = other_room(truth);
                lit(Shot { depth: noisy(&clean, &mut random), ..clean }, light, 5.0)
            };
            tally.frames += 1;
            let start = cpu_time::ProcessTime::now();
            let answer = relocaliser.add(&mut map, &shot.view(), shot.colour().as_ref(), &keyframes).unwrap();
            let cost = &mut tally.cost[usize::from(!is_inside)];
            *cost = (cost.0 + start.elapsed().as_secs_f64(), cost.1 + 1);
            if let Some(answer) = answer {
                found = Some(apart(&answer.outcome.world_from_camera, &truth));
                break;
            }
        }
        match (is_inside, found) {
            (true, Some((metres, radians))) => {
                let is_right = metres < RIGHT[0] && radians < RIGHT[1];
                *(if is_right { &mut tally.right } else { &mut tally.wrong }) += 1;
                tally.worst = [tally.worst[0].max(metres), tally.worst[1].max(radians)];
            }
            (true, None) => tally.nowhere += 1,
            (false, found) => tally.elsewhere += usize::from(found.is_some()),
        }
    }
    tally
}

#[test]
fn a_camera_is_found_in_the_room_and_not_in_another() {
    let tally = sweeps(8, 2, true);
    assert!(tally.right >= 7 && tally.wrong == 0 && tally.elsewhere == 0, "{tally:?}");
    let dark = sweeps(5, 2, false);
    assert!(dark.right >= 2 && dark.wrong <= 1 && dark.elsewhere == 0, "{dark:?}");
}

/// 200 sweeps, 30 of them in another room.
#[test]
#[ignore = "prints figures, takes minutes"]
fn relocalisation_figures() {
    for (light, name) in [(true, "with colour"), (false, "in the dark")] {
        let Tally { right, wrong, nowhere, elsewhere, frames, cost, worst } = sweeps(170, 30, light);
        let [inside, outside] = cost.map(|(seconds, frames)| 1e3 * seconds / frames as f64);
        eprintln!(
            "{name}: of 170 {right} right, {wrong} off by more than 5 mm or 0.3 deg (worst {:.1} mm, {:.2} deg), {nowhere} not found; \
             of 30 elsewhere {elsewhere} found; {:.1} frames each, {inside:.0} CPU-ms a frame, {outside:.0} elsewhere",
            1e3 * worst[0],
            worst[1].to_degrees(),
            frames as f64 / 200.0,
        );
    }
}

/// In colour one frame says where it was taken, but not where there are two places that look the same.
#[test]
fn one_frame_is_enough_unless_two_places_look_the_same() {
    let mut random = Random::new(12);
    let truths: Vec<Isometry3<f64>> =
        (0..6).map(|k| room::pose(90 + 117 * k, 720) * Isometry3::translation(0.03, -0.04, 0.02)).collect();
    for count in [1, 2] {
        let (mut map, mut keyframes) = rooms(count, &mut random, true);
        // The likest keyframes are all of the first room.
        for k in 0..10 * truths.len() {
            let pose = truths[k / 10] * Isometry3::translation(0.002 * (k % 10) as f64, 0.0, 0.0);
            let shot = lit(seen(pose, &mut random), true, 0.0);
            keyframes.push(&shot.view(), shot.colour().as_ref(), &pose).unwrap();
        }
        for truth in &truths {
            let mut relocaliser = Relocaliser::new(TrackingSettings::default()).unwrap();
            let shot = lit(seen(*truth, &mut random), true, 0.0);
            let found = relocaliser.add(&mut map, &shot.view(), shot.colour().as_ref(), &keyframes).unwrap();
            if count == 1 {
                let (metres, radians) = apart(&found.unwrap().outcome.world_from_camera, truth);
                assert!(metres < RIGHT[0] && radians < RIGHT[1], "{metres} m, {radians} rad");
            } else {
                assert!(found.is_none() && relocaliser.places() == 2, "{} places", relocaliser.places());
            }
        }
    }
}

/// The frames before the one that settled it stand where they were taken.
#[test]
fn earlier_frames_are_placed_too() {
    let mut random = Random::new(5);
    let (mut map, keyframes) = mapped(&mut random, false);
    let mut relocaliser = Relocaliser::new(TrackingSettings::default()).unwrap();
    let mut truths = Vec::new();
    for k in 0..FRAMES {
        let truth = room::pose(100 + 5 * k, 720) * Isometry3::translation(0.02, 0.03, 0.0);
        let found = relocaliser.add(&mut map, &seen(truth, &mut random).view(), None, &keyframes).unwrap();
        if let Some(found) = found {
            assert!(found.earlier.len() == truths.len() && truths.len() >= 2, "{}", found.earlier.len());
            for (pose, truth) in found.earlier.iter().zip(&truths) {
                let (metres, radians) = apart(pose, truth);
                assert!(metres < 8e-3 && radians < 6e-3, "{metres} m, {radians} rad");
            }
            assert_eq!(relocaliser.places(), 0, "the search is over");
            return;
        }
        truths.push(truth);
    }
    panic!("not found in {FRAMES} frames");
}

/// Spheres that hang in the air: nothing of the kind was mapped. And a camera that stands still before a corner in the dark, of which there
/// may be more, is not found by looking again.
#[test]
fn what_was_not_mapped_is_not_found() {
    let mut random = Random::new(6);
    let (mut map, keyframes) = mapped(&mut random, false);
    let mut relocaliser = Relocaliser::new(TrackingSettings::default()).unwrap();
    for k in 0..6 {
        let ball = crate::scene::hit_sphere(0.4 + 0.1 * f64::from(k));
        let pose = look_at(Point3::new(2.0, 0.0, 0.1 * f64::from(k)), Point3::origin());
        let shot = Shot::take((160, 120), [131.25; 2], pose, ball);
        assert!(relocaliser.add(&mut map, &shot.view(), None, &keyframes).unwrap().is_none());
    }
    let still = seen(room::pose(20, 120), &mut random);
    relocaliser.reset();
    let mut places = 0;
    for _ in 0..6 {
        assert!(relocaliser.add(&mut map, &still.view(), None, &keyframes).unwrap().is_none());
        places = relocaliser.places();
    }
    assert_eq!(places, 1, "its place is kept in mind");
    let turn = UnitQuaternion::from_euler_angles(0.0, 0.05, 0.0);
    let mut found = None;
    for k in 1..4 {
        let truth = room::pose(20, 120) * Isometry3::from_parts([0.0; 3].into(), turn.powf(f64::from(k)));
        found = relocaliser.add(&mut map, &seen(truth, &mut random).view(), None, &keyframes).unwrap();
        if found.is_some() {
            break;
        }
    }
    assert!(found.is_some(), "found once it turns");
}
