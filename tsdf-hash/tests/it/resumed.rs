//! A tracked run that was interrupted and stored goes on as if nothing had happened, to the bit.

use std::collections::BTreeMap;
use std::ops::Range;

use nalgebra::{Isometry3, Vector3};
use tsdf_hash::Settings;
use tsdf_hash::slam::{FrameMemory, OdometryError, PoseSource, Slam, SlamSettings, SlamState, trajectory_to_tum};
use tsdf_hash::storage::MapFile;

use crate::eviction::scratch;
use crate::random::Random;
use crate::scene::{Shot, room};
use crate::tracking::noisy;

const FRAMES: usize = 24;
const RATE: f64 = 30.0;

/// Noisy images of a camera that turns by two degrees from frame to frame.
fn shots() -> Vec<Shot> {
    let mut random = Random::new(8);
    (0..FRAMES)
        .map(|k| {
            let pose = room::pose(k, 180);
            let mut shot = Shot::take((160, 120), [131.25; 2], pose, |o, d| Some(room::hit(o, d)));
            shot.depth = noisy(&shot, &mut random);
            shot.painted(|p| room::colour(p, 0.0))
        })
        .collect()
}

/// Frames in a row; an odometry that drifts, and the samples of a gyroscope with a bias, from the first on, if there is one.
fn go_on(slam: &mut Slam, shots: &[Shot], frames: Range<usize>, gyroscope: bool) {
    let sample = |slam: &mut Slam, k: usize| {
        let [now, next] = [k, (k + 1).min(FRAMES - 1)].map(|k| shots[k].world_from_camera.rotation);
        let rate = (now.inverse() * next).scaled_axis() * RATE + Vector3::new(0.02, 0.0, -0.03);
        slam.angular_rate(k as f64 / RATE, rate).unwrap();
    };
    if gyroscope {
        (0..frames.start).for_each(|k| sample(slam, k));
    }
    for k in frames {
        let (shot, t) = (&shots[k], k as f64 / RATE);
        if gyroscope {
            sample(slam, k);
        }
        let drift = Isometry3::new(Vector3::new(0.0, 2e-3, 0.0) * k as f64, Vector3::new(0.0, 0.0, 1e-3) * k as f64);
        let prior = drift * shot.world_from_camera;
        let outcome = slam.frame(t, &shot.view(), shot.colour().as_ref(), Some(&prior)).unwrap();
        assert!(outcome.world_from_camera.is_some(), "{k}: {:?}", outcome.events);
    }
}

#[test]
fn an_interruption_leaves_no_trace() {
    let shots = shots();
    for (poses, gyroscope) in [
        (PoseSource::Tracked, false),
        (PoseSource::Tracked, true),
        (PoseSource::Odometry(OdometryError { turn: 0.01, shift: 0.01 }), false),
    ] {
        let map = Settings { voxel_size: 0.02, ..Settings::default() };
        let settings = SlamSettings { map, poses, ..SlamSettings::default() };
        let mut whole = Slam::new(settings.clone()).unwrap();
        go_on(&mut whole, &shots, 0..FRAMES, gyroscope);
        let whole = whole.finish().unwrap();
        for at in [2, 13] {
            let path = scratch(&format!("interrupted-{at}-{gyroscope}"));
            let mut first = Slam::new(settings.clone()).unwrap();
            go_on(&mut first, &shots, 0..at, gyroscope);
            first.save(&path, None, BTreeMap::new()).unwrap();
            drop(first);
            let mut state = SlamState::read(MapFile::open(&path).unwrap(), &map, None).unwrap();
            std::fs::remove_file(&path).unwrap();
            state.next_frame = at;
            let mut rest = Slam::with_source(settings.clone(), state, FrameMemory::new()).unwrap();
            go_on(&mut rest, &shots, at..FRAMES, gyroscope);
            let rest = rest.finish().unwrap();
            let [found, expected] = [&rest, &whole].map(|state| trajectory_to_tum(&state.trajectory));
            assert!(found == expected, "{poses:?} {gyroscope} {at}: {found}\nbut {expected}");
            assert_eq!(rest.map.hash(), whole.map.hash());
            assert!(rest.keyframes.to_bytes() == whole.keyframes.to_bytes());
        }
    }
}
