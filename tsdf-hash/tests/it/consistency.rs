//! Whether the tracker's covariance is right: normalised estimation error squared over seeded runs.

use nalgebra::{Isometry3, Matrix6, UnitQuaternion, Vector3, Vector6};
use tsdf_hash::tracking::{PosePrior, Tracker, TrackingSettings};
use tsdf_hash::{Map, Settings};

use crate::random::Random;
use crate::scene::{Shot, room};
use crate::tracking::noisy;

/// One frame against a map of noisy frames at known poses, in a world that lies anyhow on the grid of voxels.
fn normalised_error(
    seed: u64,
    voxel_size: f64,
    size: (usize, usize),
    frames: usize,
    every: usize,
) -> Option<(Vector6<f64>, Matrix6<f64>)> {
    let mut random = Random::new(seed);
    let mut direction = || Vector3::from_fn(|_, _| random.uniform() - 0.5);
    let world = Isometry3::new(direction(), direction());
    let (turn, shift) = (direction() * 0.02, direction() * 0.02);
    let focal = 525.0 * size.0 as f64 / 640.0;
    let steps = 360;
    let start = (random.uniform() * f64::from(steps)) as usize;
    let take = |k: usize| {
        let mut shot = Shot::take(size, [focal; 2], room::pose(k, steps as usize), |o, d| Some(room::hit(o, d)));
        shot.world_from_camera = world * shot.world_from_camera;
        shot
    };
    let mut map = Map::new(Settings { voxel_size, ..Settings::default() }).unwrap();
    for k in 0..frames {
        let shot = take(start + every * k);
        let depth = noisy(&shot, &mut random);
        map.integrate(&Shot { depth, ..shot.clone() }.view(), None, &shot.world_from_camera).unwrap();
    }
    let shot = take(start + every * frames / 2);
    let depth = noisy(&shot, &mut random);
    let truth = shot.world_from_camera;
    let guess = Isometry3::from_parts(
        (truth.translation.vector + shift).into(),
        UnitQuaternion::from_scaled_axis(turn) * truth.rotation,
    );
    let mut tracker = Tracker::new(TrackingSettings::default()).unwrap();
    let prior = PosePrior { world_from_camera: guess, covariance: None };
    let outcome = tracker.track(&mut map, &Shot { depth, ..shot }.view(), None, &prior).unwrap();
    if !outcome.is_tracked() || !outcome.degenerate.is_empty() {
        return None;
    }
    let turn = (truth.rotation * outcome.world_from_camera.rotation.inverse()).scaled_axis();
    let shift = truth.translation.vector - outcome.world_from_camera.translation.vector;
    Some((Vector6::new(turn.x, turn.y, turn.z, shift.x, shift.y, shift.z), outcome.covariance))
}

/// Mean and median of the NEES over seeds, with the root mean square of shift and turn; and the share of views that fix the pose.
fn nees(seeds: std::ops::Range<u64>, voxel_size: f64, size: (usize, usize), frames: usize) -> (Vec<f64>, usize) {
    let asked = (seeds.end - seeds.start) as usize;
    let runs = seeds.filter_map(|seed| normalised_error(seed, voxel_size, size, frames, 3));
    let mut sorted: Vec<f64> = runs.map(|(e, c)| e.dot(&(c.try_inverse().unwrap() * e))).collect();
    sorted.sort_by(f64::total_cmp);
    (sorted, asked)
}

/// Chi-squared of six degrees of freedom has the mean 6, the median 5.35, and 99 % below 16.8.
#[test]
fn the_covariance_is_neither_bold_nor_useless() {
    let (sorted, asked) = nees(0..60, 0.02, (160, 120), 8);
    let mean = sorted.iter().sum::<f64>() / sorted.len() as f64;
    let median = sorted[sorted.len() / 2];
    eprintln!(
        "{} of {asked}: mean {mean:.2}, median {median:.2}, largest {:.1}",
        sorted.len(),
        sorted[sorted.len() - 1]
    );
    assert!(2 * sorted.len() > asked);
    assert!((2.0..10.0).contains(&mean) && (2.0..9.0).contains(&median), "{mean} {median}");
}

/// For several maps and cameras.
#[test]
#[ignore = "prints figures, takes a minute"]
fn figures() {
    for (voxel_size, size, frames) in
        [(0.02, (160, 120), 8), (0.02, (320, 240), 8), (0.02, (320, 240), 2), (0.01, (320, 240), 8)]
    {
        let (sorted, asked) = nees(0..200, voxel_size, size, frames);
        let count = sorted.len();
        let mean = sorted.iter().sum::<f64>() / count as f64;
        eprintln!(
            "{voxel_size} m, {size:?} pixels, {frames} frames: {count} of {asked} fix the pose, mean {mean:.2}, median {:.2}, 90 % below {:.2}, largest {:.1}",
            sorted[count / 2],
            sorted[count * 9 / 10],
            sorted[count - 1]
        );
    }
}
