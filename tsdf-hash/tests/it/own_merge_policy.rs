//! A merge policy of one's own, as a closure: it compares what is seen again with what is seen now.

use nalgebra::Point3;
use tsdf_hash::storage::{MemoryLimits, MergeDecision, MergeImmediately, ReloadedBlocks};
use tsdf_hash::{Map, Settings};

use crate::eviction::{FREE, close_wall, contents, limits, make};

#[test]
fn reloaded_blocks_wait_for_a_decision() {
    let walls = [close_wall(1.0), close_wall(-1.0)];
    let memory = MemoryLimits { max_age: 1.0, merge_timeout: 10.0, ..limits(1 << 20, 0) };
    let mut map = make(Settings { memory, ..FREE }, "decision");
    let see = |map: &mut Map, side: usize, time: f64, drift: f64| {
        let mut pose = walls[side].world_from_camera;
        pose.translation.vector.x += drift;
        map.integrate_at(time, &walls[side].view(), None, &pose).unwrap()
    };
    see(&mut map, 0, 0.0, 0.0);
    let left = see(&mut map, 1, 5.0, 0.0).blocks_evicted;
    assert!(left > 0 && map.memory().host_blocks == left && map.reloaded_blocks().is_empty());
    let on_wall = Point3::new(0.405, 0.01, 0.01);
    assert!(map.distance(&on_wall).is_none());
    // Seen again, 6 mm too far: the old surface is there to compare with, and untouched.
    let back = see(&mut map, 0, 6.0, 0.006);
    assert!(back.blocks_reloaded > 0 && map.memory().reloaded_blocks == back.blocks_reloaded);
    let mut asked = 0;
    let mut policy = |reloaded: &ReloadedBlocks| {
        asked += 1;
        assert!(reloaded.reloaded_at() == Some(6.0) && reloaded.blocks().len() == reloaded.len());
        let drift = reloaded.distance(&on_wall).unwrap() - reloaded.active_distance(&on_wall).unwrap();
        assert!((drift + 0.006).abs() < 1e-5, "{drift}");
        MergeDecision::Defer
    };
    assert_eq!(map.merge_reloaded(&mut policy).unwrap(), 0);
    assert_eq!(asked, 1);
    let hash = contents(&map).0;
    assert_eq!(map.merge_reloaded(&mut MergeImmediately).unwrap(), back.blocks_reloaded);
    assert!(map.reloaded_blocks().is_empty() && map.hash() == hash);
    // The mean of the two: equal weights but for the cosine.
    assert!((map.distance(&on_wall).unwrap() + 0.002).abs() < 1e-4);
    // Without a decision they are merged when the time is up, and reported.
    see(&mut map, 1, 20.0, 0.0);
    see(&mut map, 0, 21.0, 0.0);
    assert!(!map.reloaded_blocks().is_empty());
    let late = see(&mut map, 1, 31.5, 0.0);
    assert!(late.blocks_timed_out > 0 && map.reloaded_blocks().len() == late.blocks_reloaded);
}
