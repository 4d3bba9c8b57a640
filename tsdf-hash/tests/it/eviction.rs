//! Eviction: memory with hard caps changes no bit of the map.

use std::path::PathBuf;

use nalgebra::{Isometry3, Point3};
use tsdf_hash::storage::MemoryLimits;
use tsdf_hash::{ColourData, ColourView, Error, Map, Settings};

use crate::scene::{Shot, look_at, room};

/// A place for a file of one test.
pub(crate) fn scratch(name: &str) -> PathBuf {
    std::env::temp_dir().join(format!("tsdf-hash-{name}-{}", std::process::id()))
}

pub(crate) const FREE: Settings = Settings {
    voxel_size: 0.02,
    truncation_voxels: 4.0,
    carve: 0.0,
    min_depth: 0.2,
    max_depth: 6.0,
    max_bytes: 1 << 30,
    threads: 1,
    memory: MemoryLimits { host_bytes: 0, disk_bytes: 0, max_age: 2.0, max_transfers: 1024, merge_timeout: 0.0 },
    noise: tsdf_hash::NoiseModel { base: 0.0012, quadratic: 0.0019, nearest: 0.4 },
};

pub(crate) fn limits(host_bytes: usize, disk_bytes: u64) -> MemoryLimits {
    MemoryLimits { host_bytes, disk_bytes, ..FREE.memory }
}

pub(crate) fn make(settings: Settings, name: &str) -> Map {
    if settings.memory.disk_bytes == 0 { Map::new(settings) } else { Map::with_swap(settings, &scratch(name)) }.unwrap()
}

pub(crate) fn colours(shot: &Shot) -> Vec<u8> {
    (0..3 * shot.width * shot.height).map(|k| (k * 7 % 251) as u8).collect()
}

pub(crate) fn colour_view<'a>(shot: &Shot, rgb8: &'a [u8]) -> ColourView<'a> {
    ColourView { width: shot.width, height: shot.height, data: ColourData::Rgb8(rgb8), intrinsics: shot.intrinsics }
}

pub(crate) fn add(map: &mut Map, shot: &Shot) -> Result<tsdf_hash::FrameReport, Error> {
    map.integrate(&shot.view(), Some(&colour_view(shot, &colours(shot))), &shot.world_from_camera)
}

pub(crate) fn take_out(map: &mut Map, shot: &Shot) -> Result<tsdf_hash::FrameReport, Error> {
    map.deintegrate(&shot.view(), Some(&colour_view(shot, &colours(shot))), &shot.world_from_camera)
}

fn assert_capped(map: &Map) {
    let (memory, settings) = (map.memory(), map.settings());
    assert!(memory.active_bytes <= settings.max_bytes, "{memory:?}");
    assert!(memory.host_bytes <= settings.memory.host_bytes, "{memory:?}");
    assert!(memory.disk_bytes <= settings.memory.disk_bytes, "{memory:?}");
}

/// All voxels, read back from wherever they are: not the fingerprints that are kept beside them.
pub(crate) fn contents(map: &Map) -> (u64, usize, tsdf_hash::mesh::Mesh) {
    let whole = map.consolidated().unwrap();
    assert_eq!((whole.hash(), whole.blocks()), (map.hash(), map.blocks()));
    (whole.hash(), whole.blocks(), whole.mesh())
}

#[test]
fn caps_leave_no_trace() {
    let shots = room::tour(12, 4, &Isometry3::identity());
    // The way around, and some places again after the rest.
    let order: Vec<usize> = (0..12).chain([0, 1, 7, 3]).collect();
    let mut free = make(FREE, "free");
    for &k in &order {
        add(&mut free, &shots[k]).unwrap();
    }
    let expected = contents(&free);
    let slow = MemoryLimits { max_age: 0.02, max_transfers: 5, ..limits(8 << 20, 0) };
    let waiting = MemoryLimits { merge_timeout: 0.1, ..slow };
    for (name, max_bytes, caps, threads) in [
        // Half of a frame's blocks are active at once; all the rest is compressed in RAM.
        ("ram", 1 << 20, limits(8 << 20, 0), 1),
        // Hardly a block is; most is on disk.
        ("disk", 1 << 16, limits(5 << 17, 8 << 20), 1),
        ("disk-2", 1 << 18, limits(5 << 17, 8 << 20), 2),
        // Room for everything, but blocks are evicted by age and reloaded slowly, so that many have two copies.
        ("age", 1 << 30, slow, 1),
        // Much is evicted at once and reloaded slowly: blocks have two copies.
        ("split", 1 << 21, MemoryLimits { max_transfers: 5, ..limits(8 << 20, 0) }, 1),
        ("waiting", 1 << 30, waiting, 2),
        ("waiting-tight", 1 << 20, waiting, 1),
    ] {
        let mut map = make(Settings { max_bytes, memory: caps, threads, ..FREE }, name);
        let mut moved = 0;
        for &k in &order {
            let report = add(&mut map, &shots[k]).unwrap();
            moved += report.blocks_evicted + report.blocks_reloaded;
            assert_capped(&map);
        }
        let memory = map.memory();
        assert!(map.bytes() < free.bytes() && memory.host_blocks > 0, "{name}: {memory:?}");
        assert_eq!(memory.disk_blocks > 100, caps.disk_bytes > 0);
        assert!(moved > 0, "{name}: {moved}");
        assert!(contents(&map) == expected, "{name} differs");
        // And all out again, the oldest first: what is active is from later frames, what is cold is not all.
        for &k in &order {
            take_out(&mut map, &shots[k]).unwrap();
            assert_capped(&map);
        }
        let empty = make(FREE, "empty");
        assert_eq!((map.hash(), map.blocks()), (empty.hash(), 0), "{name}");
        let memory = map.memory();
        assert_eq!(
            (memory.active_blocks, memory.reloaded_blocks, memory.host_blocks, memory.disk_blocks),
            (0, 0, 0, 0)
        );
    }
}

#[test]
fn a_frame_that_was_not_integrated_is_noticed_wherever_blocks_are() {
    let shots = room::tour(12, 4, &Isometry3::identity());
    let tight = MemoryLimits { max_age: 0.02, max_transfers: 40, ..limits(1 << 20, 8 << 20) };
    // In the last case hardly any block is active.
    for (max_bytes, merge_timeout) in [(1 << 19, 0.0), (1 << 19, 1.0), (1 << 16, 0.0)] {
        let settings = Settings { max_bytes, memory: MemoryLimits { merge_timeout, ..tight }, ..FREE };
        let mut map = make(settings, &format!("foreign-{max_bytes}-{merge_timeout}"));
        for shot in &shots[..8] {
            add(&mut map, shot).unwrap();
        }
        let before = contents(&map);
        // Never fused; fused from half a voxel elsewhere; fused without colour.
        let mut moved = shots[2].clone();
        moved.world_from_camera.translation.vector.x += 0.01;
        for shot in [&shots[10], &moved] {
            assert!(matches!(take_out(&mut map, shot).unwrap_err(), Error::NotIntegrated { .. }));
            assert!(contents(&map) == before);
            assert_capped(&map);
        }
        take_out(&mut map, &shots[2]).unwrap();
        add(&mut map, &shots[2]).unwrap();
        assert!(contents(&map) == before);
    }
}

#[test]
fn colours_that_were_not_integrated_are_noticed_in_evicted_blocks() {
    let walls = [close_wall(1.0), close_wall(-1.0)];
    let mut map = make(Settings { memory: MemoryLimits { max_age: 1.0, ..limits(1 << 20, 0) }, ..FREE }, "colours");
    for (side, time) in [(0, 0.0), (1, 5.0)] {
        map.integrate_at(time, &walls[side].view(), None, &walls[side].world_from_camera).unwrap();
    }
    let before = contents(&map);
    assert!(map.memory().host_blocks > 0 && map.memory().active_blocks + map.memory().host_blocks == map.blocks());
    // Every block is there, the depth too.
    assert!(matches!(take_out(&mut map, &walls[0]).unwrap_err(), Error::NotIntegrated { .. }));
    assert!(contents(&map) == before);
    map.deintegrate(&walls[0].view(), None, &walls[0].world_from_camera).unwrap();
    assert_eq!(map.memory().host_blocks, 0);
}

#[test]
fn full_storage_refuses_the_frame_and_nothing_else() {
    let shots = room::tour(12, 4, &Isometry3::identity());
    for (name, memory) in [("full-ram", limits(1 << 18, 0)), ("full-disk", limits(1 << 17, 1 << 18))] {
        let mut map = make(Settings { max_bytes: 1 << 19, memory, ..FREE }, name);
        let mut fused = Vec::new();
        let mut refused = 0;
        for (k, shot) in shots.iter().enumerate() {
            let before = map.hash();
            match add(&mut map, shot) {
                Ok(_) => fused.push(k),
                Err(error) => {
                    assert!(matches!(error, Error::StorageFull { .. }), "{error}");
                    assert_eq!(map.hash(), before);
                    refused += 1;
                }
            }
            assert_capped(&map);
        }
        assert!(!fused.is_empty() && refused > 3, "{name}: {fused:?}");
        let mut free = make(FREE, "free");
        for &k in &fused {
            add(&mut free, &shots[k]).unwrap();
        }
        assert!(contents(&map) == contents(&free));
        // Room again.
        for &k in &fused {
            take_out(&mut map, &shots[k]).unwrap();
        }
        assert_eq!(map.blocks(), 0);
        add(&mut map, &shots[fused[0]]).unwrap();
    }
}

/// A wall at 0.4 m, where every observation weighs 15; the camera looks along x or the other way.
pub(crate) fn close_wall(side: f64) -> Shot {
    let pose = look_at(Point3::origin(), Point3::new(side, 0.0, 0.0));
    Shot::take((12, 9), [20.0; 2], pose, |o, d| Some((0.4 * side - o.x) / d.x))
}

#[test]
fn copies_that_would_run_over_together_are_saturated() {
    // 65535 / 15 = 4369. The wall is looked at until then, in turns with another one, so that its blocks leave and come
    // back; while they wait, no copy alone is near its end.
    let walls = [close_wall(1.0), close_wall(-1.0)];
    for merge_timeout in [0.0, f64::MAX] {
        let memory = MemoryLimits { max_age: 1.0, merge_timeout, ..limits(1 << 20, 0) };
        let mut map = make(Settings { voxel_size: 0.05, memory, ..FREE }, "saturated");
        let mut time = 0.0;
        let mut look = |map: &mut Map, side: usize, pause: f64| {
            time += pause;
            map.integrate_at(time, &walls[side].view(), None, &walls[side].world_from_camera)
        };
        let mut reloaded = 0;
        for k in 0..4369 {
            // The other side for a long while, twice.
            if k % 1900 == 1899 {
                (0..2).for_each(|_| assert!(look(&mut map, 1, 2.0).is_ok()));
            }
            look(&mut map, 0, 1e-3).unwrap();
            reloaded = reloaded.max(map.memory().reloaded_blocks);
        }
        assert_eq!(reloaded > 0, merge_timeout > 0.0);
        let before = (map.hash(), map.blocks());
        assert!(matches!(look(&mut map, 0, 1e-3).unwrap_err(), Error::Saturated { .. }));
        assert_eq!((map.hash(), map.blocks()), before);
        map.deintegrate(&walls[0].view(), None, &walls[0].world_from_camera).unwrap();
        look(&mut map, 0, 1e-3).unwrap();
        assert_eq!((map.hash(), map.blocks()), before);
    }
}

#[test]
fn times_that_make_no_sense_are_refused() {
    let wall = close_wall(1.0);
    let mut map = make(FREE, "times");
    map.integrate_at(3.0, &wall.view(), None, &wall.world_from_camera).unwrap();
    let before = map.hash();
    for time in [f64::NAN, f64::INFINITY, 3.0, 2.9, -1.0] {
        let error = map.integrate_at(time, &wall.view(), None, &wall.world_from_camera).unwrap_err();
        assert!(matches!(error, Error::InvalidTime { last: 3.0, .. }));
        assert_eq!(map.hash(), before);
    }
    // Corrections need no time.
    map.deintegrate(&wall.view(), None, &wall.world_from_camera).unwrap();
    map.integrate(&wall.view(), None, &wall.world_from_camera).unwrap();
    map.integrate_at(3.1, &wall.view(), None, &wall.world_from_camera).unwrap();
    assert!(matches!(Map::new(Settings { memory: limits(1 << 20, 1), ..FREE }), Err(Error::SwapFileMismatch { .. })));
    assert!(matches!(Map::with_swap(FREE, &scratch("none")), Err(Error::SwapFileMismatch { .. })));
    let nowhere = scratch("no-such-folder").join("swap");
    let swap = Map::with_swap(Settings { memory: limits(1 << 20, 1), ..FREE }, &nowhere);
    assert!(matches!(swap, Err(Error::Io { .. })));
}

/// Walls far apart, each seen once at its own time.
fn wall_at(y: f64) -> Shot {
    let pose = look_at(Point3::new(0.0, y, 0.0), Point3::new(1.0, y, 0.0));
    Shot::take((12, 9), [20.0; 2], pose, |o, d| Some((0.4 - o.x) / d.x))
}

/// Which of the walls are in active memory: only those answer.
fn active_walls(map: &Map, walls: &[f64]) -> Vec<bool> {
    walls.iter().map(|y| map.distance(&Point3::new(0.405, y + 0.01, 0.01)).is_some()).collect()
}

#[test]
fn blocks_are_evicted_by_age_the_oldest_first() {
    let memory = MemoryLimits { max_age: 1.5, ..limits(1 << 20, 0) };
    let walls = [0.0, 10.0, 20.0, 30.0];
    let see = |map: &mut Map, wall: usize, time: f64| {
        let shot = wall_at(walls[wall]);
        map.integrate_at(time, &shot.view(), None, &shot.world_from_camera).unwrap()
    };
    let mut map = make(Settings { memory, ..FREE }, "age");
    (0..3).for_each(|k| assert_eq!(see(&mut map, k, k as f64 * 0.5).blocks_evicted, 0));
    // Ages of 1.5, 1.0 and 0.5 s: not older than the limit yet.
    assert_eq!(see(&mut map, 3, 1.5).blocks_evicted, 0);
    assert_eq!(active_walls(&map, &walls), [true; 4]);
    // Seen again, the first one is young; the second is 1.6 s old.
    assert_eq!(see(&mut map, 0, 2.0).blocks_evicted, 0);
    assert!(see(&mut map, 3, 2.1).blocks_evicted > 0);
    assert_eq!(active_walls(&map, &walls), [true, false, true, true]);
    // A frame without a surface there does not make it younger.
    assert!(see(&mut map, 3, 2.6).blocks_evicted > 0);
    assert_eq!(active_walls(&map, &walls), [true, false, false, true]);
    // Few at a time: those that were not seen for longest go first.
    let few = see(&mut make(FREE, "count"), 0, 0.0).blocks;
    let slow = MemoryLimits { max_age: 0.5, max_transfers: few, ..limits(1 << 20, 0) };
    let mut map = make(Settings { memory: slow, ..FREE }, "slow-age");
    for (k, wall) in [2, 0, 1].into_iter().enumerate() {
        see(&mut map, wall, k as f64 * 0.1);
    }
    for (time, active) in
        [(2.0, [true, true, false, true]), (2.1, [false, true, false, true]), (2.2, [false, false, false, true])]
    {
        assert_eq!(see(&mut map, 3, time).blocks_evicted, few);
        assert_eq!(active_walls(&map, &walls), active, "{time}");
    }
}

/// The same for colours, of which 1040 fit: neither copy has so many alone.
#[test]
fn copies_whose_colours_would_run_over_together_are_saturated() {
    let walls = [close_wall(1.0), close_wall(-1.0)];
    let memory = MemoryLimits { max_age: 1.0, merge_timeout: f64::MAX, ..limits(1 << 20, 0) };
    let mut map = make(Settings { voxel_size: 0.05, memory, ..FREE }, "saturated-colours");
    let rgb8 = colours(&walls[0]);
    let colour = colour_view(&walls[0], &rgb8);
    let mut time = 0.0;
    let mut look = |map: &mut Map, side: usize, pause: f64| {
        time += pause;
        map.integrate_at(time, &walls[side].view(), Some(&colour), &walls[side].world_from_camera)
    };
    for k in 0..1040 {
        if k == 600 {
            // The other side for a long while: the first copy is evicted, and waits when it is reloaded.
            (0..2).for_each(|_| assert!(look(&mut map, 1, 2.0).is_ok()));
        }
        look(&mut map, 0, 1e-3).unwrap();
    }
    assert!(map.memory().reloaded_blocks > 0);
    let before = (map.hash(), map.blocks());
    assert!(matches!(look(&mut map, 0, 1e-3).unwrap_err(), Error::Saturated { .. }));
    assert_eq!((map.hash(), map.blocks()), before);
    // Merged they are the same map, and still full.
    map.merge_reloaded(&mut tsdf_hash::storage::MergeImmediately).unwrap();
    assert_eq!((map.hash(), map.blocks()), before);
    assert!(matches!(look(&mut map, 0, 1e-3).unwrap_err(), Error::Saturated { .. }));
}
