//! A camera that turns by up to ten degrees and moves by up to ten centimetres from frame to frame, before six worlds: every frame that is
//! placed is placed right.

use tsdf_hash::Settings;
use tsdf_hash::slam::{Slam, SlamSettings};

use crate::noisy_room::apart;
use crate::random::Random;
use crate::tracking::noisy;
use crate::worlds::{World, shaken};

/// A frame that is off by more is wrong, metres.
const WRONG: f64 = 0.02;
const FRAMES: usize = 9;

/// Frames that were placed right, placed wrong, and left out; and the largest error of those that were placed.
fn run(world: World, [degrees, metres]: [f64; 2], seed: u64, light: bool) -> ([usize; 3], f64) {
    let map = Settings { voxel_size: 0.02, ..Settings::default() };
    let mut slam = Slam::new(SlamSettings { map, ..SlamSettings::default() }).unwrap();
    let (mut counts, mut worst) = ([0; 3], 0.0_f64);
    let mut random = Random::new(seed);
    for (k, truth) in shaken(FRAMES, degrees, metres, seed).into_iter().enumerate() {
        let mut shot = world.shot(truth, seed);
        if seed % 2 == 1 {
            shot.depth = noisy(&shot, &mut random);
        }
        let colour = shot.colour().filter(|_| light);
        let outcome = slam.frame(k as f64 / 30.0, &shot.view(), colour.as_ref(), None).unwrap();
        let Some(pose) = outcome.world_from_camera else {
            counts[2] += 1;
            continue;
        };
        let off = apart(&pose, &truth).0;
        worst = worst.max(off);
        counts[usize::from(off > WRONG)] += 1;
    }
    (counts, worst)
}

/// Three to ten degrees and one to ten centimetres.
fn motion(seed: u64) -> [f64; 2] {
    let mut random = Random::new(1000 + seed);
    [3.0 + 7.0 * random.uniform(), 0.01 + 0.09 * random.uniform()]
}

#[test]
fn a_fast_camera_is_placed_right_or_not_at_all() {
    for world in World::ALL {
        for motion in [[9.5, 0.03], [7.0, 0.06]] {
            let ([right, wrong, left_out], worst) = run(world, motion, 3, true);
            assert!(wrong == 0 && right >= FRAMES - 1, "{world:?} {motion:?}: {right}, {wrong}, {left_out}; {worst} m");
        }
    }
}

/// With noise, the rims of the steps tell one step from the next.
#[test]
fn a_step_is_not_taken_for_the_next() {
    let ([right, wrong, left_out], worst) = run(World::Stairs, motion(9), 9, true);
    assert!(wrong == 0 && right == FRAMES, "{right}, {wrong}, {left_out}; {worst} m");
}

#[test]
#[ignore = "figures of the book, half a minute"]
fn fast_cameras() {
    figures(true);
}

#[test]
#[ignore = "figures of the book, half a minute"]
fn fast_cameras_in_the_dark() {
    figures(false);
}

fn figures(light: bool) {
    let mut total = [0; 3];
    for world in World::ALL {
        let (mut counts, mut worst) = ([0; 3], 0.0_f64);
        for seed in 0..20 {
            let (of_run, off) = run(world, motion(seed), seed, light);
            (0..3).for_each(|k| counts[k] += of_run[k]);
            worst = worst.max(off);
        }
        println!("{world:?}: {counts:?} right, wrong, left out; worst {:.1} mm", 1e3 * worst);
        (0..3).for_each(|k| total[k] += counts[k]);
    }
    println!("all: {total:?}");
}
