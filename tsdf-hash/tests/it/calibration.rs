//! A camera that is not what it is said to be: the frames of a camera that turns tell.

use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use tsdf_hash::slam::{CameraDoubt, Event, Slam, SlamSettings};
use tsdf_hash::{DepthView, Intrinsics, Settings};

use crate::random::Random;
use crate::tracking::noisy;
use crate::worlds::World;

const FRAMES: usize = 36;

/// A camera in the hand: turns by up to four degrees from frame to frame, by 25 degrees to each side in all.
fn in_the_hand(k: usize, seed: u64) -> Isometry3<f64> {
    let (t, phase) = (k as f64, seed as f64);
    let start = Vector3::new((phase * 1.3).sin(), (phase * 0.7).sin(), phase.sin());
    let wave = |rate: f64, start: f64| (rate * t + start).sin() - start.sin();
    let turn = Vector3::new(0.2 * wave(0.23, start.x), 0.4 * wave(0.16, start.y), 0.1 * wave(0.1, start.z));
    let shift = Vector3::new(0.15 * wave(0.12, start.z), 0.1 * wave(0.17, start.x), 0.15 * wave(0.1, start.y));
    Isometry3::from_parts(shift.into(), UnitQuaternion::from_scaled_axis(turn))
}

struct Run {
    events: usize,
    doubt: Option<CameraDoubt>,
    placed: usize,
}

/// Maps a world with a camera that is said to be another one.
fn run(world: World, seed: u64, said: impl Fn(Intrinsics) -> Intrinsics) -> Run {
    let map = Settings { voxel_size: 0.02, ..Settings::default() };
    let mut slam = Slam::new(SlamSettings { map, ..SlamSettings::default() }).unwrap();
    let mut random = Random::new(seed);
    let (mut events, mut placed) = (0, 0);
    for k in 0..FRAMES {
        let mut shot = world.shot(in_the_hand(k, seed), seed);
        if seed % 2 == 1 {
            shot.depth = noisy(&shot, &mut random);
        }
        let intrinsics = said(shot.intrinsics);
        let colour = shot.colour().map(|colour| tsdf_hash::ColourView { intrinsics, ..colour });
        let view = DepthView { intrinsics, ..shot.view() };
        let outcome = slam.frame(k as f64 / 30.0, &view, colour.as_ref(), None).unwrap();
        placed += usize::from(outcome.world_from_camera.is_some());
        events += outcome.events.iter().filter(|event| matches!(event, Event::CameraDoubted(_))).count();
    }
    Run { events, doubt: slam.camera_doubt(), placed }
}

fn focal(by: f64) -> impl Fn(Intrinsics) -> Intrinsics {
    move |k| Intrinsics { fx: k.fx * by, fy: k.fy * by, ..k }
}

fn centre(x: f64, y: f64) -> impl Fn(Intrinsics) -> Intrinsics {
    move |k| Intrinsics { cx: k.cx + x, cy: k.cy + y, ..k }
}

/// Sides taken for each other, as of a portrait image.
fn swapped(k: Intrinsics) -> Intrinsics {
    Intrinsics { cx: k.cy, cy: k.cx, ..k }
}

/// Prints how many of forty wrong cameras are doubted, how near what fits better comes, and how many of twenty right ones are doubted:
/// `cargo test --release -p tsdf-hash --test it -- --ignored --nocapture wrong_cameras`.
#[test]
#[ignore = "figures of the book, a minute"]
fn wrong_cameras() {
    let worlds = |k: usize| (World::ALL[k % 6], k as u64);
    let mut doubted = 0;
    for k in 0..20 {
        let (world, seed) = worlds(k);
        let run = run(world, seed, |k| k);
        doubted += usize::from(run.doubt.is_some());
        println!("right {world:?} {seed}: placed {} events {} {:?}", run.placed, run.events, run.doubt);
    }
    let (mut named, mut near) = (0, 0);
    for k in 0..40 {
        let (world, seed) = worlds(k);
        let by = [0.6, 0.7, 0.8, 0.9, 0.95, 1.05, 1.1, 1.2, 1.3, 1.4][k % 10];
        let far = [[20.0, 0.0], [-30.0, 10.0], [0.0, 25.0], [40.0, -20.0]][k % 4];
        let run = match k {
            0..26 => run(world, seed, focal(by)),
            26..34 => run(world, seed, centre(far[0], far[1])),
            _ => run(world, seed, swapped),
        };
        named += usize::from(run.doubt.is_some());
        let off = run.doubt.map(|doubt| doubt.fits_better.fx / 262.5 - 1.0);
        near += usize::from(off.is_some_and(|off| off.abs() < 0.01));
        println!(
            "wrong {k} {world:?} {seed} by {by}: placed {} events {} {:?} off {off:?}",
            run.placed,
            run.events,
            run.doubt.map(|d| d.agreement)
        );
    }
    println!("doubted: {named} of 40 wrong ones, {doubted} of 20 right ones; within 1 %: {near}");
}

#[test]
fn a_wrong_focal_length_is_named_and_a_right_one_is_not_doubted() {
    let right = run(World::SphereInRoom, 1, |k| k);
    assert!(right.doubt.is_none() && right.events == 0 && right.placed == FRAMES, "{:?}", right.doubt);
    let wrong = run(World::SphereInRoom, 1, focal(0.9));
    let doubt = wrong.doubt.unwrap();
    assert_eq!(wrong.events, 1, "it is said once");
    assert!((doubt.fits_better.fx / 262.5 - 1.0).abs() < 0.01 && doubt.agreement[0] < doubt.agreement[1], "{doubt:?}");
}
