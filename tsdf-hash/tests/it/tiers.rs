//! Memory with hard caps changes no bit of the map.

use std::path::PathBuf;

use nalgebra::{Isometry3, Point3};
use tsdf_hash::{Arrivals, ColourData, ColourView, Error, Map, Settings, Tiers, Verdict};

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
    tiers: Tiers { host_bytes: 0, disk_bytes: 0, age: 2.0, transfers: 1024, hold: 0.0 },
    noise: tsdf_hash::NoiseModel { base: 0.0012, quadratic: 0.0019, nearest: 0.4 },
};

fn tiers(host_bytes: usize, disk_bytes: u64) -> Tiers {
    Tiers { host_bytes, disk_bytes, ..FREE.tiers }
}

fn make(settings: Settings, name: &str) -> Map {
    if settings.tiers.disk_bytes == 0 { Map::new(settings) } else { Map::with_swap(settings, &scratch(name)) }.unwrap()
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
    assert!(memory.host_bytes <= settings.tiers.host_bytes, "{memory:?}");
    assert!(memory.disk_bytes <= settings.tiers.disk_bytes, "{memory:?}");
}

/// All voxels of all tiers, read back from wherever they are: not the prints that are kept beside them.
pub(crate) fn contents(map: &Map) -> (u64, usize, tsdf_hash::Mesh) {
    let whole = map.whole().unwrap();
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
    let slow = Tiers { age: 0.02, transfers: 5, ..tiers(8 << 20, 0) };
    let held = Tiers { hold: 0.1, ..slow };
    for (name, max_bytes, tiers, threads) in [
        // Half of a frame's blocks are active at once; all the rest is packed in RAM.
        ("ram", 1 << 20, tiers(8 << 20, 0), 1),
        // Hardly a block is; most is on disk.
        ("disk", 1 << 16, tiers(5 << 17, 8 << 20), 1),
        ("disk-2", 1 << 18, tiers(5 << 17, 8 << 20), 2),
        // Room for everything, but blocks leave by age and come back slowly, so that many have two copies.
        ("age", 1 << 30, slow, 1),
        // Much leaves at once and comes back slowly: blocks have two copies.
        ("split", 1 << 21, Tiers { transfers: 5, ..tiers(8 << 20, 0) }, 1),
        ("held", 1 << 30, held, 2),
        ("held-tight", 1 << 20, held, 1),
    ] {
        let mut map = make(Settings { max_bytes, tiers, threads, ..FREE }, name);
        let mut moved = 0;
        for &k in &order {
            let report = add(&mut map, &shots[k]).unwrap();
            moved += report.blocks_left + report.blocks_arrived;
            assert_capped(&map);
        }
        let memory = map.memory();
        assert!(map.bytes() < free.bytes() && memory.host_blocks > 0, "{name}: {memory:?}");
        assert_eq!(memory.disk_blocks > 100, tiers.disk_bytes > 0);
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
        assert_eq!((memory.active_blocks, memory.held_blocks, memory.host_blocks, memory.disk_blocks), (0, 0, 0, 0));
    }
}

#[test]
fn what_was_not_in_is_noticed_in_every_tier() {
    let shots = room::tour(12, 4, &Isometry3::identity());
    let tight = Tiers { age: 0.02, transfers: 40, ..tiers(1 << 20, 8 << 20) };
    // In the last case hardly any block is active.
    for (max_bytes, hold) in [(1 << 19, 0.0), (1 << 19, 1.0), (1 << 16, 0.0)] {
        let settings = Settings { max_bytes, tiers: Tiers { hold, ..tight }, ..FREE };
        let mut map = make(settings, &format!("foreign-{max_bytes}-{hold}"));
        for shot in &shots[..8] {
            add(&mut map, shot).unwrap();
        }
        let before = contents(&map);
        // Never fused; fused from half a voxel elsewhere; fused without colour.
        let mut moved = Shot { depth: shots[2].depth.clone(), ..shots[2] };
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
fn colours_that_were_not_in_are_noticed_in_cold_blocks() {
    let walls = [close_wall(1.0), close_wall(-1.0)];
    let mut map = make(Settings { tiers: Tiers { age: 1.0, ..tiers(1 << 20, 0) }, ..FREE }, "colours");
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
fn full_tiers_refuse_the_frame_and_nothing_else() {
    let shots = room::tour(12, 4, &Isometry3::identity());
    for (name, tiers) in [("full-ram", tiers(1 << 18, 0)), ("full-disk", tiers(1 << 17, 1 << 18))] {
        let mut map = make(Settings { max_bytes: 1 << 19, tiers, ..FREE }, name);
        let mut fused = Vec::new();
        let mut refused = 0;
        for (k, shot) in shots.iter().enumerate() {
            let before = map.hash();
            match add(&mut map, shot) {
                Ok(_) => fused.push(k),
                Err(error) => {
                    assert!(matches!(error, Error::TiersFull { .. }), "{error}");
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
fn close_wall(side: f64) -> Shot {
    let pose = look_at(Point3::origin(), Point3::new(side, 0.0, 0.0));
    Shot::take((12, 9), [20.0; 2], pose, |o, d| Some((0.4 * side - o.x) / d.x))
}

#[test]
fn copies_that_would_run_over_together_are_saturated() {
    // 65535 / 15 = 4369. The wall is looked at until then, in turns with another one, so that its blocks leave and come
    // back; while they are held, no copy alone is near its end.
    let walls = [close_wall(1.0), close_wall(-1.0)];
    for hold in [0.0, f64::MAX] {
        let tiers = Tiers { age: 1.0, hold, ..tiers(1 << 20, 0) };
        let mut map = make(Settings { voxel_size: 0.05, tiers, ..FREE }, "saturated");
        let mut time = 0.0;
        let mut look = |map: &mut Map, side: usize, pause: f64| {
            time += pause;
            map.integrate_at(time, &walls[side].view(), None, &walls[side].world_from_camera)
        };
        let mut held = 0;
        for k in 0..4369 {
            // The other side for a long while, twice.
            if k % 1900 == 1899 {
                (0..2).for_each(|_| assert!(look(&mut map, 1, 2.0).is_ok()));
            }
            look(&mut map, 0, 1e-3).unwrap();
            held = held.max(map.memory().held_blocks);
        }
        assert_eq!(held > 0, hold > 0.0);
        let before = (map.hash(), map.blocks());
        assert!(matches!(look(&mut map, 0, 1e-3).unwrap_err(), Error::Saturated { .. }));
        assert_eq!((map.hash(), map.blocks()), before);
        map.deintegrate(&walls[0].view(), None, &walls[0].world_from_camera).unwrap();
        look(&mut map, 0, 1e-3).unwrap();
        assert_eq!((map.hash(), map.blocks()), before);
    }
}

#[test]
fn what_comes_back_waits_for_a_verdict() {
    let walls = [close_wall(1.0), close_wall(-1.0)];
    let tiers = Tiers { age: 1.0, hold: 10.0, ..tiers(1 << 20, 0) };
    let mut map = make(Settings { tiers, ..FREE }, "verdict");
    let see = |map: &mut Map, side: usize, time: f64, drift: f64| {
        let mut pose = walls[side].world_from_camera;
        pose.translation.vector.x += drift;
        map.integrate_at(time, &walls[side].view(), None, &pose).unwrap()
    };
    see(&mut map, 0, 0.0, 0.0);
    let left = see(&mut map, 1, 5.0, 0.0).blocks_left;
    assert!(left > 0 && map.memory().host_blocks == left && map.arrivals().is_empty());
    let on_wall = Point3::new(0.405, 0.01, 0.01);
    assert!(map.distance(&on_wall).is_none());
    // Seen again, 6 mm too far: the old surface is there to compare with, and untouched.
    let back = see(&mut map, 0, 6.0, 0.006);
    assert!(back.blocks_arrived > 0 && map.memory().held_blocks == back.blocks_arrived);
    let mut judged = 0;
    let mut judge = |arrivals: &Arrivals| {
        judged += 1;
        assert!(arrivals.since() == Some(6.0) && arrivals.blocks().len() == arrivals.len());
        let drift = arrivals.distance(&on_wall).unwrap() - arrivals.map().distance(&on_wall).unwrap();
        assert!((drift + 0.006).abs() < 1e-5, "{drift}");
        Verdict::Hold
    };
    assert_eq!(map.revisit(&mut judge).unwrap(), 0);
    assert_eq!(judged, 1);
    let hash = contents(&map).0;
    assert_eq!(map.revisit(&mut tsdf_hash::MergeAtOnce).unwrap(), back.blocks_arrived);
    assert!(map.arrivals().is_empty() && map.hash() == hash);
    // The mean of the two: equal weights but for the cosine.
    assert!((map.distance(&on_wall).unwrap() + 0.002).abs() < 1e-4);
    // Without a verdict they are merged when the time is up, and reported.
    see(&mut map, 1, 20.0, 0.0);
    see(&mut map, 0, 21.0, 0.0);
    assert!(!map.arrivals().is_empty());
    let late = see(&mut map, 1, 31.5, 0.0);
    assert!(late.blocks_overdue > 0 && map.arrivals().len() == late.blocks_arrived);
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
    assert!(matches!(Map::new(Settings { tiers: tiers(1 << 20, 1), ..FREE }), Err(Error::SwapFile { .. })));
    assert!(matches!(Map::with_swap(FREE, &scratch("none")), Err(Error::SwapFile { .. })));
    let nowhere = scratch("no-such-folder").join("swap");
    let swap = Map::with_swap(Settings { tiers: tiers(1 << 20, 1), ..FREE }, &nowhere);
    assert!(matches!(swap, Err(Error::Io { .. })));
}
