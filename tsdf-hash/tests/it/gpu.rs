//! The map on a GPU is the map on the processor, to the bit. Skipped where there is no adapter, unless
//! `PAINTCOPTER_REQUIRE_GPU=1` demands one.

use std::collections::BTreeMap;

use nalgebra::{Isometry3, Point3, Vector3};
use tsdf_hash::distance_field::{DistanceField, DistanceSettings};
use tsdf_hash::gpu::{GpuMap, GpuOptions};
use tsdf_hash::layer::TsdfLayer;
use tsdf_hash::mesh::IncrementalMesher;
use tsdf_hash::ray_cast::RayCastSettings;
use tsdf_hash::slam::DeviceMap;
use tsdf_hash::storage::MemoryLimits;
use tsdf_hash::{ColourData, ColourView, DenseMap, DepthData, DepthView, Error, Intrinsics, Map, Settings};

use crate::eviction::{limits, scratch};
use crate::random::Random;
use crate::scene::{Shot, look_at, room};

pub(crate) fn options() -> GpuOptions {
    GpuOptions { software: true, ..GpuOptions::default() }
}

/// `None`, said aloud, where no adapter is there and none is demanded.
pub(crate) fn open(settings: Settings, options: &GpuOptions) -> Option<GpuMap> {
    match GpuMap::new(settings, options) {
        Ok(map) => Some(map),
        Err(error @ Error::NoAdapter { .. })
            if std::env::var_os("PAINTCOPTER_REQUIRE_GPU").is_none_or(|v| v != "1") =>
        {
            eprintln!("skipped: {error}");
            None
        }
        Err(error) => panic!("{error}"),
    }
}

pub(crate) fn on_device(map: Map) -> GpuMap {
    GpuMap::from_map(map, &options()).map_err(|refused| refused.1).unwrap()
}

/// A shot with colours of its own, of half the size.
pub(crate) struct Frame {
    pub(crate) shot: Shot,
    rgb8: Vec<u8>,
}

impl Frame {
    pub(crate) fn tour(n: usize, shrink: usize) -> Vec<Self> {
        let moved = Isometry3::new(Vector3::new(3.7, -2.1, 1.3), Vector3::new(0.1, 0.05, -0.4));
        let colours = |k: usize, pixels: usize| (0..3 * pixels).map(|n| (n * 31 + k * 77 + n / 97) as u8).collect();
        let frame = |(k, shot): (usize, Shot)| Self { rgb8: colours(k, shot.width * shot.height / 4), shot };
        room::tour(n, shrink, &moved).into_iter().enumerate().map(frame).collect()
    }

    pub(crate) fn colour(&self) -> ColourView<'_> {
        let data = ColourData::Rgb8(&self.rgb8);
        let (mut intrinsics, s) = (self.shot.intrinsics, 0.5);
        (intrinsics.fx, intrinsics.fy) = (s * intrinsics.fx, s * intrinsics.fy);
        (intrinsics.cx, intrinsics.cy) = (s * intrinsics.cx - 0.25, s * intrinsics.cy - 0.25);
        ColourView { width: self.shot.width / 2, height: self.shot.height / 2, data, intrinsics }
    }
}

pub(crate) fn settings() -> Settings {
    Settings { voxel_size: 0.03, max_bytes: 32 << 20, ..Settings::default() }
}

#[test]
fn the_gpu_makes_the_bytes_of_the_processor() {
    let Some(mut gpu) = open(settings(), &options()) else { return };
    // Pages of 3 MiB: the blocks of a frame lie on several.
    let paged = GpuOptions { max_buffer_bytes: 3 << 20, ..options() };
    let mut small = open(Settings { max_bytes: 13 << 20, ..settings() }, &paged).unwrap();
    let mut map = Map::new(settings()).unwrap();
    let frames = Frame::tour(7, 4);
    let mut hashes = vec![map.hash()];
    for frame in &frames {
        let (view, pose) = (frame.shot.view(), frame.shot.world_from_camera);
        let report = map.integrate(&view, Some(&frame.colour()), &pose).unwrap();
        assert_eq!(gpu.integrate(&view, Some(&frame.colour()), &pose).unwrap(), report);
        assert_eq!(small.integrate(&view, Some(&frame.colour()), &pose).unwrap(), report);
        hashes.push(map.hash());
        assert_eq!((gpu.hash().unwrap(), gpu.blocks()), (map.hash(), map.blocks()));
        assert_eq!(small.hash().unwrap(), map.hash());
    }
    let files = [scratch("file-cpu"), scratch("file-gpu")];
    map.save(&files[0], Some(&map.mesh()), &BTreeMap::new()).unwrap();
    gpu.save(&files[1], Some(&map.mesh()), &BTreeMap::new()).unwrap();
    let [expected, found] = files.map(|path| (std::fs::read(&path).unwrap(), std::fs::remove_file(&path).unwrap()).0);
    assert!(found == expected, "the files differ");
    // Out again, from the last to the first: each map of the way back is one of the way there.
    for (frame, hash) in frames.iter().zip(&hashes).rev() {
        let (view, pose) = (frame.shot.view(), frame.shot.world_from_camera);
        let report = map.deintegrate(&view, Some(&frame.colour()), &pose).unwrap();
        assert_eq!(gpu.deintegrate(&view, Some(&frame.colour()), &pose).unwrap(), report);
        assert_eq!(gpu.hash().unwrap(), *hash);
    }
    assert_eq!(gpu.blocks(), 0);
    // In another order, into slots that other blocks have left.
    for k in [3, 0, 6, 2, 5, 1, 4] {
        let frame = &frames[k];
        gpu.integrate(&frame.shot.view(), Some(&frame.colour()), &frame.shot.world_from_camera).unwrap();
    }
    assert_eq!(Some(&gpu.hash().unwrap()), hashes.last());
}

/// Cameras of either handedness anywhere in the room, walls at arm's length included; 16-bit colours of a camera that sees
/// only a part of the image.
#[test]
fn odd_cameras_agree() {
    // Some of the free space is carved.
    let settings = Settings { carve: 0.4, ..settings() };
    let Some(mut gpu) = open(settings, &options()) else { return };
    let mut map = Map::new(settings).unwrap();
    let mut random = Random::new(7);
    let mut unit = || random.uniform();
    let mut fused = 0;
    for k in 0..12 {
        let at = Vector3::new(5.0 * unit() - 2.5, 3.0 * unit() - 1.5, 2.4 * unit() + 0.3);
        let turn = Vector3::new(6.0 * unit() - 3.0, 6.0 * unit() - 3.0, 6.0 * unit() - 3.0);
        let focal = [90.0 + 40.0 * unit(), 90.0 + 40.0 * unit()];
        let focal = [if k % 2 == 0 { focal[0] } else { -focal[0] }, if k % 3 == 0 { -focal[1] } else { focal[1] }];
        let shot = Shot::take((121, 83), focal, Isometry3::new(at, turn), |o, d| Some(room::hit(o, d)));
        let depth: Vec<u16> = shot.depth.iter().map(|z| (5000.0 * z) as u16).collect();
        let view = DepthView { data: DepthData::U16 { data: &depth, scale: 5000.0 }, ..shot.view() };
        let rgb16: Vec<u16> = (0..3 * 61 * 47).map(|n| (n * 7919 + k * 977) as u16).collect();
        let (fx, fy) = (0.7 * focal[0], 0.6 * focal[1]);
        let intrinsics = Intrinsics { fx, fy, cx: 28.3, cy: 25.1 };
        let colour = ColourView { width: 61, height: 47, data: ColourData::Rgb16(&rgb16), intrinsics };
        let pose = shot.world_from_camera;
        match (map.integrate(&view, Some(&colour), &pose), gpu.integrate(&view, Some(&colour), &pose)) {
            (Ok(expected), Ok(found)) => {
                assert_eq!(found, expected);
                fused += 1;
            }
            (Err(expected), Err(found)) => assert_eq!(found.to_string(), expected.to_string()),
            (expected, found) => panic!("{expected:?} but {found:?}"),
        }
        assert_eq!(gpu.hash().unwrap(), map.hash());
    }
    assert!(fused > 8);
}

#[test]
fn a_full_image_agrees() {
    let settings = Settings { voxel_size: 0.01, max_bytes: 128 << 20, ..Settings::default() };
    let Some(mut gpu) = open(settings, &options()) else { return };
    let mut map = Map::new(settings).unwrap();
    let frame = &Frame::tour(1, 1)[0];
    let (view, pose) = (frame.shot.view(), frame.shot.world_from_camera);
    let report = map.integrate(&view, Some(&frame.colour()), &pose).unwrap();
    assert!(report.blocks > 1000);
    assert_eq!(gpu.integrate(&view, Some(&frame.colour()), &pose).unwrap(), report);
    assert_eq!(gpu.hash().unwrap(), map.hash());
}

#[test]
fn the_same_rays_hit_the_same_surface() {
    let paged = GpuOptions { max_buffer_bytes: 8 << 20, ..options() };
    let settings = Settings { voxel_size: 0.02, max_bytes: 31 << 20, ..Settings::default() };
    let Some(mut gpu) = open(settings, &paged) else { return };
    let mut map = Map::new(settings).unwrap();
    let frames = Frame::tour(8, 4);
    let look = |gpu: &mut GpuMap, map: &Map, pose: &Isometry3<f64>, colour| {
        let cast = RayCastSettings { colour, ..RayCastSettings::default() };
        let k = frames[0].shot.intrinsics;
        let (expected, found) =
            (map.ray_cast(&k, 161, 117, pose, &cast).unwrap(), gpu.ray_cast(&k, 161, 117, pose, &cast).unwrap());
        assert_eq!((found.width, found.height, found.world_from_camera), (161, 117, *pose));
        assert_eq!(found.depth, expected.depth);
        assert_eq!(found.normals, expected.normals);
        assert_eq!(found.colours, expected.colours);
        assert_eq!(found.weights, expected.weights);
        expected.hits()
    };
    assert_eq!(look(&mut gpu, &map, &Isometry3::identity(), true), 0);
    for frame in &frames {
        let (view, pose) = (frame.shot.view(), frame.shot.world_from_camera);
        // Half of the images without colours.
        let colour = Some(frame.colour()).filter(|_| pose.translation.x > 3.5);
        map.integrate(&view, colour.as_ref(), &pose).unwrap();
        gpu.integrate(&view, colour.as_ref(), &pose).unwrap();
    }
    assert_eq!(gpu.hash().unwrap(), map.hash());
    for (k, frame) in frames.iter().enumerate() {
        // From where the image was taken, and from elsewhere.
        let aside = Isometry3::new(Vector3::new(0.1, -0.2, 0.15), Vector3::new(0.3, 0.2, -0.1));
        assert!(look(&mut gpu, &map, &frame.shot.world_from_camera, k % 2 == 0) > 15_000);
        assert!(look(&mut gpu, &map, &(frame.shot.world_from_camera * aside), k % 2 == 1) > 5_000);
    }
}

#[test]
fn a_map_moves_to_the_device_and_back() {
    let settings = Settings { voxel_size: 0.02, max_bytes: 64 << 20, ..Settings::default() };
    let Some(mut gpu) = open(settings, &options()) else { return };
    let mut map = Map::new(settings).unwrap();
    let frames = Frame::tour(4, 4);
    let add = |frame: &Frame, map: &mut Map| {
        map.integrate(&frame.shot.view(), Some(&frame.colour()), &frame.shot.world_from_camera).unwrap();
    };
    for frame in &frames[..2] {
        add(frame, &mut map);
    }
    assert!(map.blocks() > 512, "one batch is no test of the streaming");
    let mut moved = on_device(map.consolidated().unwrap());
    for frame in &frames[2..] {
        add(frame, &mut map);
        moved.integrate(&frame.shot.view(), Some(&frame.colour()), &frame.shot.world_from_camera).unwrap();
    }
    for frame in &frames {
        gpu.integrate(&frame.shot.view(), Some(&frame.colour()), &frame.shot.world_from_camera).unwrap();
    }
    assert_eq!((moved.hash().unwrap(), gpu.hash().unwrap()), (map.hash(), map.hash()));
    let back = moved.to_map(64 << 20).unwrap();
    assert_eq!((back.hash(), back.mesh()), (map.hash(), map.mesh()));
    assert!(matches!(moved.to_map(1 << 20), Err(Error::OutOfBudget { .. })));
    let whole = moved.into_map().unwrap();
    assert_eq!((whole.hash(), whole.mesh()), (map.hash(), map.mesh()));
}

pub(crate) fn wall() -> Shot {
    let pose = look_at(Point3::origin(), Point3::new(1.0, 0.1, 0.05));
    Shot::take((64, 48), [60.0; 2], pose, |o, d| Some((1.2 - o.x) / d.x))
}

#[test]
fn refused_frames_leave_no_trace() {
    let shot = wall();
    let (view, pose) = (shot.view(), shot.world_from_camera);
    let settings = Settings { voxel_size: 0.04, max_bytes: 1 << 20, ..Settings::default() };
    if open(settings, &options()).is_none() {
        return;
    }
    let mut map = Map::new(settings).unwrap();
    let rgb8 = vec![255; 3 * 3072];
    let colour = ColourView { width: 64, height: 48, data: ColourData::Rgb8(&rgb8), intrinsics: shot.intrinsics };
    // 1040 coloured frames fill a voxel.
    for _ in 0..1039 {
        map.integrate(&view, Some(&colour), &pose).unwrap();
    }
    let mut gpu = on_device(map.consolidated().unwrap());
    gpu.integrate(&view, Some(&colour), &pose).unwrap();
    map.integrate(&view, Some(&colour), &pose).unwrap();
    let full = map.hash();
    assert_eq!(gpu.hash().unwrap(), full);
    let (ours, expected) =
        (gpu.integrate(&view, Some(&colour), &pose), map.integrate(&view, Some(&colour), &pose).unwrap_err());
    let (Err(Error::Saturated { block }), Error::Saturated { block: first }) = (ours, expected) else { panic!() };
    assert_eq!((block, gpu.hash().unwrap()), (first, full));
    // Where there is room they take the frame, and give it back.
    let beside = Isometry3::translation(0.0, 0.5, 0.0) * pose;
    let (mut ours, mut theirs) = (Vec::new(), Vec::new());
    let reports = [
        gpu.integrate_where_room(&view, Some(&colour), &beside, &mut ours).unwrap(),
        map.integrate_where_room(&view, Some(&colour), &beside, &mut theirs).unwrap(),
    ];
    assert!(reports[0].blocks_added > 0 && !ours.is_empty(), "{reports:?}");
    assert_eq!((reports[0].voxels, &ours, gpu.hash().unwrap()), (reports[1].voxels, &theirs, map.hash()));
    let reports = [
        gpu.deintegrate_except(&view, Some(&colour), &beside, &ours).unwrap(),
        map.deintegrate_except(&view, Some(&colour), &beside, &theirs).unwrap(),
    ];
    assert_eq!((gpu.hash().unwrap(), map.hash()), (full, full), "{reports:?}");
    // A wall so near that every observation weighs 15: 4369 of them fill a voxel.
    let near = Shot::take((24, 18), [20.0; 2], Isometry3::identity(), |_, d| Some(0.4 / d.z));
    let mut heavy = Map::new(settings).unwrap();
    for _ in 0..4369 {
        heavy.integrate(&near.view(), None, &near.world_from_camera).unwrap();
    }
    let mut moved = on_device(heavy.consolidated().unwrap());
    let expected = heavy.integrate(&near.view(), None, &near.world_from_camera).unwrap_err();
    assert!(matches!(expected, Error::Saturated { .. }));
    let found = moved.integrate(&near.view(), None, &near.world_from_camera).unwrap_err();
    assert_eq!((found.to_string(), moved.hash().unwrap()), (expected.to_string(), heavy.hash()));
    // Strangers: one that reaches blocks which are not there, and one that does not.
    let moved = Isometry3::translation(0.0, 0.0, 0.3) * pose;
    assert!(matches!(gpu.deintegrate(&view, None, &moved), Err(Error::NotIntegrated { .. })));
    assert_eq!(gpu.hash().unwrap(), full);
    let near = Isometry3::translation(0.0, 0.02, 0.0) * pose;
    let strange = vec![999; 3 * 3072];
    let other = gpu.deintegrate(&view, Some(&ColourView { data: ColourData::Rgb16(&strange), ..colour }), &near);
    assert!(matches!(other, Err(Error::NotIntegrated { .. })));
    assert_eq!(gpu.hash().unwrap(), full);
    // And one that was there.
    gpu.deintegrate(&view, Some(&colour), &pose).unwrap();
    map.deintegrate(&view, Some(&colour), &pose).unwrap();
    assert_eq!(gpu.hash().unwrap(), map.hash());
}

#[test]
fn the_cap_holds_on_the_device() {
    let shot = wall();
    let settings = Settings { voxel_size: 0.02, max_bytes: 1 << 19, ..Settings::default() };
    let Some(mut gpu) = open(settings, &options()) else { return };
    let mut refused = 0;
    for k in 0..12 {
        let turned = Isometry3::rotation(Vector3::z() * (0.3 * f64::from(k))) * shot.world_from_camera;
        let before = (gpu.hash().unwrap(), gpu.blocks());
        if let Err(error) = gpu.integrate(&shot.view(), None, &turned) {
            assert!(matches!(error, Error::OutOfBudget { max_bytes: 0x80000, .. }));
            assert_eq!((gpu.hash().unwrap(), gpu.blocks()), before);
            refused += 1;
        }
        assert!(gpu.bytes() <= 1 << 19);
    }
    assert!((1..12).contains(&refused));
    let Err(Error::InvalidSetting { name, .. }) = GpuMap::new(Settings { max_bytes: 1000, ..settings }, &options())
    else {
        panic!("1000 bytes were accepted")
    };
    assert_eq!(name, "max_bytes");
}

#[test]
fn an_adapter_that_is_not_there_is_an_error() {
    let nowhere = GpuOptions { adapter: "no such adapter".into(), ..options() };
    let Err(Error::NoAdapter { reason }) = GpuMap::new(settings(), &nowhere) else { panic!("it was found") };
    assert!(!reason.is_empty());
    // The processor takes over, and the reason says so.
    let on = |options: &GpuOptions| DeviceMap::on_adapter(Map::new(settings()).unwrap(), options);
    let (mut map, reason) = on(&nowhere);
    assert!(reason.unwrap().to_string().contains("no GPU"));
    let shot = wall();
    let map = map.dense_mut();
    map.integrate(&shot.view(), None, &shot.world_from_camera).unwrap();
    let expected = map.hash().unwrap();
    if let (mut map, None) = on(&options()) {
        let map = map.dense_mut();
        map.integrate(&shot.view(), None, &shot.world_from_camera).unwrap();
        assert_eq!((map.hash().unwrap(), map.mesh().unwrap().faces.is_empty()), (expected, false));
    }
}

/// The mesh, the distance field and distance queries follow a map wherever it is kept.
#[test]
fn followers_see_the_same_map_on_the_device() {
    let settings = Settings { voxel_size: 0.04, max_bytes: 32 << 20, ..Settings::default() };
    let Some(mut gpu) = open(settings, &options()) else { return };
    // On the last one most blocks are evicted.
    let memory = MemoryLimits { max_age: 1.5, ..limits(8 << 20, 0) };
    let mut tight = open(Settings { max_bytes: 1 << 19, memory, ..settings }, &options()).unwrap();
    let mut cpu = Map::new(settings).unwrap();
    let mut meshers = [(); 3].map(|()| IncrementalMesher::new());
    let mut fields = [(); 3].map(|()| DistanceField::new(&DistanceSettings::default()).unwrap());
    let frames = Frame::tour(5, 4);
    let mut removed = 0;
    // In, one of them again from where it changes the same blocks a little, and three out again.
    let again = Isometry3::translation(0.004, 0.003, 0.002);
    let added = (0..6).map(|step| (step % 5, step < 5, true));
    for (step, (frame, given, add)) in added.chain((0..3).map(|frame| (frame, true, false))).enumerate() {
        let pose = frames[frame].shot.world_from_camera;
        let pose = if given { pose } else { again * pose };
        let (view, colour) = (frames[frame].shot.view(), frames[frame].colour());
        let mut reports = Vec::new();
        for (k, map) in [&mut cpu as &mut dyn DenseMap, &mut gpu, &mut tight].into_iter().enumerate() {
            if add {
                map.integrate_at(step as f64, &view, Some(&colour), &pose).unwrap();
            } else {
                map.deintegrate(&view, Some(&colour), &pose).unwrap();
            }
            reports.push((meshers[k].update(&*map).unwrap(), fields[k].update(&*map).unwrap()));
        }
        assert_eq!(reports[0], reports[1]);
        let mesh = cpu.mesh();
        assert!(meshers.iter_mut().all(|mesher| mesher.mesh() == mesh));
        let [expected, found @ ..] = &fields;
        assert!(expected.sites().count() > 1000 && found.iter().all(|field| field.sites().eq(expected.sites())));
        removed += reports[0].0.removed;
        let mesh = cpu.mesh();
        assert!(meshers.iter_mut().all(|mesher| mesher.mesh() == mesh));
        let [expected, found @ ..] = &fields;
        assert!(expected.sites().count() > 1000 && found.iter().all(|field| field.sites().eq(expected.sites())));
    }
    assert!(removed > 100 && tight.memory().host_blocks > 50, "{removed}, {:?}", tight.memory());
    let mesh = DenseMap::mesh(&gpu).unwrap();
    assert_eq!(mesh, cpu.mesh());
    let mut known = 0;
    for position in mesh.positions.iter().step_by(mesh.positions.len() / 40) {
        let point = Point3::from(position.map(|c| f64::from(c) + 0.01));
        let expected = cpu.distance_and_gradient(&point);
        assert_eq!(gpu.distance_and_gradient(&point).unwrap(), expected);
        assert_eq!(tight.distance_and_gradient(&point).unwrap(), expected);
        assert_eq!(TsdfLayer::distance(&cpu, &point).unwrap(), cpu.distance(&point));
        known += usize::from(expected.is_some());
    }
    assert!(known > 20, "{known}");
    // Time does not go back on either.
    let (view, pose) = (frames[0].shot.view(), frames[0].shot.world_from_camera);
    for map in [&mut cpu as &mut dyn DenseMap, &mut gpu] {
        let refused = map.integrate_at(3.0, &view, None, &pose);
        assert!(matches!(refused, Err(Error::InvalidTime { last: 5.0, .. })), "{refused:?}");
    }
}
