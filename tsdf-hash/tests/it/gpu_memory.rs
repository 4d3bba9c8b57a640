//! A map on a GPU in bounded memory: blocks are evicted and reloaded, and no bit changes.

use std::collections::BTreeMap;

use nalgebra::{Isometry3, Vector3};
use tsdf_hash::gpu::{GpuMap, GpuOptions};
use tsdf_hash::ray_cast::RayCastSettings;
use tsdf_hash::storage::{MapFile, MemoryLimits, MemoryUsage};
use tsdf_hash::{DenseMap, Error, FrameReport, Map, Settings};

use crate::evicted_views::evicted_views_come_back;
use crate::eviction::{limits, make, scratch};
use crate::gpu::{Frame, on_device, open, options, settings, wall};

/// What does not depend on where the blocks are.
fn work(report: FrameReport) -> FrameReport {
    FrameReport { blocks_evicted: 0, blocks_reloaded: 0, ..report }
}

/// The tour, and some places again after the rest, on a device that has no room for it: every frame does what it does to a map that
/// keeps everything, whatever is evicted, and comes out again.
#[test]
fn a_device_without_room_evicts_and_reloads_and_no_bit_changes() {
    if open(settings(), &options()).is_none() {
        return;
    }
    let frames = Frame::tour(12, 4);
    let order: Vec<usize> = (0..12).chain([0, 1, 7, 3]).collect();
    let slow = MemoryLimits { max_age: 0.02, max_transfers: 5, ..limits(8 << 20, 0) };
    for (name, max_bytes, memory, threads) in [
        // A quarter of what the map wants.
        ("quarter", 3 << 20, limits(16 << 20, 0), 1),
        // Half of a frame's blocks; the rest is fused on the processor.
        ("half", 1 << 20, limits(8 << 20, 0), 2),
        // Hardly a block; most is on disk.
        ("disk", 1 << 16, limits(1 << 20, 16 << 20), 1),
        // Room for everything, but blocks are evicted by age and reloaded slowly.
        ("age", 64 << 20, slow, 1),
    ] {
        let settings = Settings { voxel_size: 0.02, max_bytes, memory, threads, ..Settings::default() };
        let mut free = Map::new(Settings { max_bytes: 64 << 20, memory: limits(0, 0), ..settings }).unwrap();
        let mut gpu = on_device(make(settings, name));
        let [mut evicted, mut reloaded] = [0; 2];
        for &k in &order {
            let (view, colour, pose) = (frames[k].shot.view(), frames[k].colour(), frames[k].shot.world_from_camera);
            let expected = free.integrate(&view, Some(&colour), &pose).unwrap();
            let report = gpu.integrate(&view, Some(&colour), &pose).unwrap();
            assert_eq!(work(report), expected, "{name}");
            evicted += report.blocks_evicted;
            reloaded += report.blocks_reloaded;
            assert_capped(&gpu.memory(), &settings);
            assert_eq!((gpu.hash().unwrap(), gpu.blocks()), (free.hash(), free.blocks()), "{name}");
        }
        let used = gpu.memory();
        assert!(used.host_blocks + used.disk_blocks > 50 && used.active_blocks < free.blocks(), "{name}: {used:?}");
        assert_eq!((used.disk_blocks > 100, evicted > 0), (memory.disk_bytes > 0, name == "age"), "{name}: {used:?}");
        assert!(reloaded > 0, "{name}");
        assert_eq!(DenseMap::mesh(&gpu).unwrap(), free.mesh(), "{name}");
        for &k in &order {
            let (view, colour, pose) = (frames[k].shot.view(), frames[k].colour(), frames[k].shot.world_from_camera);
            let expected = free.deintegrate(&view, Some(&colour), &pose).unwrap();
            assert_eq!(gpu.deintegrate(&view, Some(&colour), &pose).unwrap(), expected, "{name}");
            assert_capped(&gpu.memory(), &settings);
        }
        let used = gpu.memory();
        assert_eq!((used.active_blocks, used.host_blocks, used.disk_blocks), (0, 0, 0), "{name}");
        assert_eq!(gpu.hash().unwrap(), free.hash());
    }
}

/// A surface that was evicted is there again for the ray cast once a frame has seen it.
#[test]
fn what_is_seen_again_is_cast_again() {
    let settings =
        Settings { voxel_size: 0.03, max_bytes: 2 << 20, memory: limits(32 << 20, 0), ..Settings::default() };
    let Some(mut gpu) = open(settings, &options()) else { return };
    let frames = Frame::tour(8, 4);
    let shot = &frames[0].shot;
    let look = |gpu: &mut GpuMap| {
        let cast = RayCastSettings::default();
        gpu.ray_cast(&shot.intrinsics, shot.width, shot.height, &shot.world_from_camera, &cast).unwrap()
    };
    let add = |gpu: &mut GpuMap, frame: &Frame| {
        gpu.integrate(&frame.shot.view(), None, &frame.shot.world_from_camera).unwrap();
    };
    add(&mut gpu, &frames[0]);
    let first = look(&mut gpu);
    assert!(first.hits() > 15_000, "{}", first.hits());
    for frame in &frames[2..7] {
        add(&mut gpu, frame);
    }
    assert!(look(&mut gpu).hits() < first.hits() / 4, "it was not evicted");
    // The same once more: weights of two frames show that the old blocks came back.
    add(&mut gpu, &frames[0]);
    let again = look(&mut gpu);
    let both = |k: &usize| first.depth[*k] > 0.0 && again.depth[*k] > 0.0;
    let twice = (0..first.depth.len()).filter(both).filter(|&k| again.weights[k] >= 2 * first.weights[k]).count();
    assert!(twice > first.hits() * 9 / 10, "{twice} of {}", first.hits());
}

#[test]
fn evicted_views_come_back_on_the_device() {
    let settings =
        Settings { voxel_size: 0.02, max_bytes: 6 << 20, memory: limits(16 << 20, 0), ..Settings::default() };
    let Some(mut gpu) = open(settings, &options()) else { return };
    evicted_views_come_back(&mut gpu, settings);
}

#[test]
fn a_map_moves_to_the_device_and_back_with_all_its_memory() {
    let free = Settings { voxel_size: 0.02, max_bytes: 64 << 20, ..Settings::default() };
    let settings = Settings { max_bytes: 2 << 20, memory: limits(1 << 20, 16 << 20), ..free };
    if open(free, &options()).is_none() {
        return;
    }
    let frames = Frame::tour(8, 4);
    let mut free = Map::new(free).unwrap();
    let mut map = make(settings, "to-and-fro");
    for (k, frame) in frames.iter().enumerate() {
        let (view, pose, time) = (frame.shot.view(), frame.shot.world_from_camera, 0.5 * k as f64);
        free.integrate_at(time, &view, None, &pose).unwrap();
        if k % 2 == 0 {
            map.integrate_at(time, &view, None, &pose).unwrap();
            continue;
        }
        // Every other frame on the device.
        let disk_blocks = map.memory().disk_blocks;
        let mut gpu = on_device(map);
        assert_eq!(gpu.memory().disk_blocks, disk_blocks);
        assert!(matches!(gpu.integrate_at(0.0, &view, None, &pose), Err(Error::InvalidTime { .. })));
        gpu.integrate_at(time, &view, None, &pose).unwrap();
        let mut copy = gpu.to_map(64 << 20).unwrap();
        assert!(matches!(copy.integrate_at(0.0, &view, None, &pose), Err(Error::InvalidTime { .. })));
        assert_eq!((copy.hash(), copy.mesh()), (free.hash(), free.mesh()));
        assert!(matches!(gpu.to_map(1 << 20), Err(Error::OutOfBudget { .. })));
        let path = scratch("of-both");
        gpu.save(&path, None, &BTreeMap::new()).unwrap();
        let stored = MapFile::open(&path).unwrap().into_map(free.settings().to_owned(), None).unwrap();
        std::fs::remove_file(&path).unwrap();
        assert_eq!((stored.hash(), stored.mesh()), (free.hash(), free.mesh()));
        map = gpu.into_map().unwrap();
        assert_eq!((map.hash(), map.blocks(), *map.settings()), (free.hash(), free.blocks(), settings));
        assert_capped(&map.memory(), &settings);
    }
    assert!(map.memory().disk_blocks > 100);
}

/// What cannot be kept is refused, and the map that was to move comes back.
#[test]
fn refusals_leave_the_map_with_its_owner() {
    let shot = wall();
    let settings = Settings { voxel_size: 0.02, max_bytes: 4 << 20, ..Settings::default() };
    if open(settings, &options()).is_none() {
        return;
    }
    let waiting = MemoryLimits { merge_timeout: 1.0, ..limits(8 << 20, 0) };
    let mut map = Map::new(Settings { memory: waiting, ..settings }).unwrap();
    map.integrate(&shot.view(), None, &shot.world_from_camera).unwrap();
    let hash = map.hash();
    let refused = GpuMap::from_map(map, &options()).err().unwrap();
    assert!(matches!(refused.1, Error::InvalidSetting { name: "memory.merge_timeout", .. }));
    assert_eq!(refused.0.hash(), hash);
    // More active blocks than a device with small buffers has room for: none can be evicted, or they are.
    let few = GpuOptions { max_buffer_bytes: 1 << 17, ..options() };
    for memory in [limits(0, 0), limits(8 << 20, 0)] {
        let mut map = Map::new(Settings { voxel_size: 0.01, memory, ..settings }).unwrap();
        map.integrate(&shot.view(), None, &shot.world_from_camera).unwrap();
        let (hash, blocks) = (map.hash(), map.blocks());
        match GpuMap::from_map(map, &few) {
            Ok(gpu) => {
                let used = gpu.memory();
                assert!(memory.host_bytes > 0 && used.host_blocks > 0, "{used:?}");
                assert_eq!((gpu.hash().unwrap(), used.host_blocks + used.active_blocks), (hash, blocks));
            }
            Err(refused) => {
                assert!(memory.host_bytes == 0 && matches!(refused.1, Error::OutOfBudget { .. }), "{}", refused.1);
                assert_eq!(refused.0.hash(), hash);
            }
        }
    }
    // Neither the device nor the processor has room for a frame, which may have changed what is evicted next.
    let full = Settings { max_bytes: 1 << 18, memory: limits(1 << 16, 0), ..settings };
    let mut gpu = open(full, &options()).unwrap();
    let mut refused = 0;
    for k in [0, 2, 4, 1, 3, 5, 7, 6] {
        let turned = Isometry3::rotation(Vector3::z() * (0.3 * f64::from(k))) * shot.world_from_camera;
        let before = (gpu.hash().unwrap(), gpu.blocks());
        if let Err(error) = gpu.integrate(&shot.view(), None, &turned) {
            assert!(matches!(error, Error::StorageFull { .. }), "{error}");
            assert_eq!((gpu.hash().unwrap(), gpu.blocks()), before);
            refused += 1;
        }
    }
    assert!(refused > 0);
    // A device holds a little more than the processor's active memory of as many bytes: nothing is lost on the way back.
    let hash = gpu.hash().unwrap();
    let map = gpu.into_map().unwrap();
    assert_eq!(map.hash(), hash);
    assert!(map.bytes() <= map.settings().max_bytes, "{} of {}", map.bytes(), map.settings().max_bytes);
    // Strangers are noticed wherever their blocks are.
    let tight = Settings { voxel_size: 0.01, max_bytes: 1 << 18, memory: limits(8 << 20, 0), ..settings };
    let mut gpu = open(tight, &options()).unwrap();
    gpu.integrate(&shot.view(), None, &shot.world_from_camera).unwrap();
    assert!(gpu.memory().host_blocks > 0);
    let before = gpu.hash().unwrap();
    for aside in [0.3, 0.02] {
        let moved = Isometry3::translation(0.0, 0.0, aside) * shot.world_from_camera;
        assert!(matches!(gpu.deintegrate(&shot.view(), None, &moved), Err(Error::NotIntegrated { .. })));
        assert_eq!(gpu.hash().unwrap(), before);
    }
}

fn assert_capped(memory: &MemoryUsage, settings: &Settings) {
    assert!(memory.active_bytes <= settings.max_bytes, "{memory:?}");
    assert!(memory.host_bytes <= settings.memory.host_bytes, "{memory:?}");
    assert!(memory.disk_bytes <= settings.memory.disk_bytes, "{memory:?}");
}
