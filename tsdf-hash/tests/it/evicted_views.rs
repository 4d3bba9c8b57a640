//! A place that was evicted is brought back to be looked at: by a lost camera, and by one whose run goes on.

use std::collections::BTreeMap;

use nalgebra::Isometry3;
use tsdf_hash::place_recognition::KeyframeIndex;
use tsdf_hash::ray_cast::{RayCastSettings, View};
use tsdf_hash::slam::{FrameMemory, PoseSource, Slam, SlamSettings, SlamState};
use tsdf_hash::storage::{MapFile, MemoryLimits};
use tsdf_hash::tracking::{Relocaliser, TrackingSettings};
use tsdf_hash::{DenseMap, Map, Settings};

use crate::eviction::{FREE, limits, make, scratch};
use crate::noisy_room::{apart, seen};
use crate::random::Random;
use crate::relocalisation::mapped;
use crate::scene::{Shot, room};

fn look(map: &mut dyn DenseMap, shot: &Shot) -> View {
    let cast = RayCastSettings::default();
    map.ray_cast(&shot.intrinsics, shot.width, shot.height, &shot.world_from_camera, &cast).unwrap()
}

/// How many blocks come back.
fn reload(map: &mut dyn DenseMap, shot: &Shot) -> usize {
    let cast = RayCastSettings::default();
    map.reload_view(&shot.intrinsics, shot.width, shot.height, &shot.world_from_camera, &cast).unwrap()
}

/// From where it began a map that has evicted most shows again what one that keeps everything does.
pub(crate) fn evicted_views_come_back(map: &mut dyn DenseMap, settings: Settings) {
    let shots = room::tour(12, 4, &Isometry3::identity());
    let mut free = make(Settings { max_bytes: 1 << 30, memory: limits(0, 0), ..settings }, "whole");
    for shot in &shots[..7] {
        DenseMap::integrate(&mut free, &shot.view(), None, &shot.world_from_camera).unwrap();
        map.integrate(&shot.view(), None, &shot.world_from_camera).unwrap();
    }
    for (k, shot) in [&shots[0], &shots[4], &shots[1]].into_iter().enumerate() {
        let expected = look(&mut free, shot);
        let before = look(map, shot);
        let reloaded = reload(map, shot);
        assert_eq!(before.depth != expected.depth, reloaded > 0);
        assert!(expected.hits() > 15_000 && (k > 0 || reloaded > 50), "{} hits, {reloaded}", expected.hits());
        let found = look(map, shot);
        assert_eq!((found.depth, found.weights), (expected.depth, expected.weights));
        assert_eq!(reload(map, shot), 0, "everything in view is there");
        assert!(map.bytes() <= settings.max_bytes);
        assert_eq!(map.hash().unwrap(), free.hash());
    }
}

#[test]
fn evicted_views_come_back_on_the_processor() {
    for (name, max_bytes, memory) in [
        ("tight", 6 << 20, limits(16 << 20, 0)),
        ("disk", 6 << 20, limits(1 << 20, 16 << 20)),
        ("aged", 64 << 20, MemoryLimits { max_age: 0.1, ..limits(16 << 20, 0) }),
        ("waiting", 64 << 20, MemoryLimits { max_age: 0.1, merge_timeout: f64::MAX, ..limits(16 << 20, 0) }),
    ] {
        let settings = Settings { max_bytes, memory, ..FREE };
        evicted_views_come_back(&mut make(settings, name), settings);
    }
    let mut free = make(FREE, "free");
    assert_eq!(reload(&mut free, &room::tour(1, 4, &Isometry3::identity())[0]), 0);
}

/// The nearest blocks come first where there is no room for all of a view, and what is in view already stays.
#[test]
fn the_nearest_comes_first() {
    let settings = Settings { max_bytes: 1 << 20, memory: limits(16 << 20, 0), ..FREE };
    let shots = room::tour(12, 4, &Isometry3::identity());
    let mut map = make(settings, "nearest");
    for shot in &shots[..7] {
        map.integrate(&shot.view(), None, &shot.world_from_camera).unwrap();
    }
    assert!(reload(&mut map, &shots[0]) > 50);
    let view = look(&mut map, &shots[0]);
    let mut free = make(FREE, "all");
    free.integrate(&shots[0].view(), None, &shots[0].world_from_camera).unwrap();
    let expected = look(&mut free, &shots[0]);
    assert!(view.hits() > 2000 && view.hits() < expected.hits() / 2, "{} of {}", view.hits(), expected.hits());
    let mean = |shown: bool| {
        let all = view.depth.iter().zip(&expected.depth).filter(|(own, all)| **all > 0.0 && (**own > 0.0) == shown);
        all.clone().map(|(_, depth)| depth).sum::<f32>() / all.count() as f32
    };
    assert!(mean(true) < mean(false), "{} {}", mean(true), mean(false));
    let again = reload(&mut map, &shots[0]);
    let kept = (0..view.depth.len()).filter(|&k| view.depth[k] > 0.0);
    let later = look(&mut map, &shots[0]);
    assert!(kept.clone().all(|k| later.depth[k] == view.depth[k]), "{again} drove out what was in view");
}

/// What is in memory of a stored map that may evict is nothing until a frame touches it.
fn reopened(map: &Map, name: &str, max_bytes: usize) -> Map {
    let path = scratch(name);
    map.save(&path, None, &BTreeMap::new()).unwrap();
    let file = MapFile::open(&path).unwrap();
    let settings = Settings { max_bytes, memory: limits(64 << 20, 0), ..*map.settings() };
    let map = file.into_map(settings, None).unwrap();
    std::fs::remove_file(&path).unwrap();
    assert_eq!(map.memory().active_blocks, 0);
    map
}

#[test]
fn a_lost_camera_is_found_where_everything_is_evicted() {
    let mut random = Random::new(5);
    let (map, keyframes) = mapped(&mut random, true);
    // The room of one view: the map of the lost camera itself must evict, too.
    let mut map = reopened(&map, "lost", 3 << 20);
    let mut relocaliser = Relocaliser::new(TrackingSettings::default()).unwrap();
    for k in [3, 50, 97] {
        let truth = room::pose(k, 120) * Isometry3::translation(0.02, 0.03, 0.0);
        let shot = seen(truth, &mut random).painted(|p| room::colour(p, 0.0));
        let found = relocaliser.add(&mut map, &shot.view(), shot.colour().as_ref(), &keyframes).unwrap().unwrap();
        let (metres, radians) = apart(&found.outcome.world_from_camera, &truth);
        assert!(metres < 5e-3 && radians < 5e-3, "{metres} m, {radians} rad");
        relocaliser.reset();
    }
}

/// An image of a camera that turns by nearly a degree from one to the next.
fn painted(k: usize) -> Shot {
    let pose = room::pose(k, 400);
    Shot::take((160, 120), [131.25; 2], pose, |o, d| Some(room::hit(o, d))).painted(|p| room::colour(p, 0.0))
}

/// A run goes on in a stored map from where it stood, without keyframes that would find a lost camera; with and without fusing.
#[test]
fn a_run_goes_on_where_everything_is_evicted() {
    let map = Settings { voxel_size: 0.02, ..Settings::default() };
    let settings = SlamSettings { map, poses: PoseSource::Tracked, ..SlamSettings::default() };
    let mut slam = Slam::new(settings.clone()).unwrap();
    let step = |slam: &mut Slam, k: usize| {
        let shot = painted(k);
        let first = Some(&shot.world_from_camera).filter(|_| k == 0);
        let outcome = slam.frame(k as f64 / 30.0, &shot.view(), shot.colour().as_ref(), first).unwrap();
        outcome.world_from_camera.map(|pose| apart(&pose, &shot.world_from_camera))
    };
    for k in 0..70 {
        step(&mut slam, k).unwrap();
    }
    let state = slam.finish().unwrap();
    for fuse in [true, false] {
        let map = reopened(&state.map, &format!("on-{fuse}"), 16 << 20);
        let (keyframes, trajectory) = (KeyframeIndex::new(), state.trajectory[..12].to_vec());
        let state = SlamState { map, keyframes, trajectory, last_stamp: 0.0, next_frame: 12, frontend: None };
        let settings = SlamSettings { fuse, ..settings.clone() };
        let mut slam = Slam::with_source(settings, state, FrameMemory::new()).unwrap();
        for k in 12..70 {
            let (metres, radians) = step(&mut slam, k).unwrap();
            assert!(metres < 5e-3 && radians < 5e-3, "frame {k}, fused: {fuse}: {metres} m, {radians} rad");
        }
    }
}

/// Beside the whole map the search for loops keeps two small ones: what they have no room for leaves them, too.
#[cfg(feature = "pose-graph")]
#[test]
fn loops_are_looked_for_in_little_memory() {
    let map = Settings { max_bytes: 3 << 19, memory: limits(16 << 20, 16 << 20), ..FREE };
    let loops = Some(tsdf_hash::loop_closure::LoopSettings::default());
    let settings = SlamSettings { map, loops, ..SlamSettings::default() };
    let mut slam = Slam::with_source(settings, SlamState::new(make(map, "loops")), FrameMemory::new()).unwrap();
    for k in 0..60 {
        let shot = painted(k);
        let first = Some(&shot.world_from_camera).filter(|_| k == 0);
        let outcome = slam.frame(f64::from(k as u32) / 30.0, &shot.view(), shot.colour().as_ref(), first).unwrap();
        let pose = outcome.world_from_camera.unwrap_or_else(|| panic!("{k}: {:?}", outcome.events));
        let (metres, radians) = apart(&pose, &shot.world_from_camera);
        assert!(metres < 0.02 && radians < 0.02, "frame {k}: {metres} m, {radians} rad");
    }
    assert!(slam.map().memory().host_blocks > 100);
}
