//! Every input that is refused, and that the map does not notice.

use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion, Vector3};
use tsdf_hash::layer::{TsdfLayer, VoxelBlock};
use tsdf_hash::{ColourData, ColourView, DepthData, DepthView, Error, Map, NoiseModel, Settings};

use crate::scene::{Shot, look_at};

fn wall() -> Shot {
    let pose = look_at(Point3::origin(), Point3::new(1.0, 0.1, 0.05));
    Shot::take((64, 48), [60.0; 2], pose, |o, d| Some((1.2 - o.x) / d.x))
}

fn map_of(shot: &Shot) -> Map {
    let mut map = Map::new(Settings { voxel_size: 0.02, ..Settings::default() }).unwrap();
    map.integrate(&shot.view(), None, &shot.world_from_camera).unwrap();
    map
}

#[test]
fn settings_out_of_range_are_named() {
    let good = Settings::default();
    let noise = |base| NoiseModel { base, ..NoiseModel::default() };
    for (settings, field) in [
        (Settings { voxel_size: f64::NAN, ..good }, "voxel_size"),
        (Settings { voxel_size: 0.0, ..good }, "voxel_size"),
        (Settings { truncation_voxels: 0.5, ..good }, "truncation_voxels"),
        (Settings { carve: -0.1, ..good }, "carve"),
        (Settings { carve: f64::NAN, ..good }, "carve"),
        (Settings { min_depth: -1.0, ..good }, "min_depth"),
        (Settings { max_depth: f64::INFINITY, ..good }, "max_depth"),
        (Settings { max_depth: 0.1, ..good }, "max_depth"),
        (Settings { max_bytes: 1000, ..good }, "max_bytes"),
        (Settings { threads: 0, ..good }, "threads"),
        (Settings { noise: noise(0.0), ..good }, "noise.base"),
    ] {
        let Err(Error::InvalidSetting { name, .. }) = Map::new(settings) else { panic!("{settings:?} was accepted") };
        assert_eq!(name, field);
    }
}

#[test]
fn views_that_make_no_sense_change_nothing() {
    let shot = wall();
    let mut map = map_of(&shot);
    let before = map.hash();
    let (good, pose) = (shot.view(), shot.world_from_camera);
    let mut refuse = |view: DepthView, colour: Option<&ColourView>, pose: &Isometry3<f64>| {
        let error = map.integrate(&view, colour, pose).unwrap_err();
        assert_eq!(map.hash(), before);
        assert!(!error.to_string().is_empty());
        error
    };
    assert!(matches!(refuse(DepthView { width: 0, ..good }, None, &pose), Error::InvalidSize { width: 0, .. }));
    assert!(matches!(refuse(DepthView { width: 65, ..good }, None, &pose), Error::WrongLength { found: 3072, .. }));
    for (fx, cy) in [(0.0, 24.0), (f64::NAN, 24.0), (60.0, f64::INFINITY)] {
        let mut intrinsics = good.intrinsics;
        (intrinsics.fx, intrinsics.cy) = (fx, cy);
        assert!(matches!(refuse(DepthView { intrinsics, ..good }, None, &pose), Error::InvalidIntrinsics { .. }));
    }
    for scale in [0.0, -1000.0, f64::NAN] {
        let data = DepthData::U16 { data: &[1000; 3072], scale };
        assert!(matches!(refuse(DepthView { data, ..good }, None, &pose), Error::InvalidScale { .. }));
    }
    for value in [0_u16, u16::MAX, 100] {
        let data = DepthData::U16 { data: &[value; 3072], scale: 1000.0 };
        assert!(matches!(refuse(DepthView { data, ..good }, None, &pose), Error::NoDepth { valid: 0 }));
    }
    for value in [f32::NAN, f32::INFINITY, -1.0] {
        let data = DepthData::F32 { data: &[value; 3072] };
        assert!(matches!(refuse(DepthView { data, ..good }, None, &pose), Error::NoDepth { valid: 0 }));
    }
    // Thirteen depths, none more than three times in any window: nothing but edges.
    let scattered = |k: usize| (500.0 * 1.2_f64.powi(((k % 64 + 5 * (k / 64)) % 13) as i32)) as u16;
    let scattered: Vec<u16> = (0..3072).map(scattered).collect();
    let data = DepthData::U16 { data: &scattered, scale: 1000.0 };
    assert!(matches!(refuse(DepthView { data, ..good }, None, &pose), Error::NoDepth { valid: 3072 }));
    let rgb8 = vec![0; 3 * 3072 - 1];
    let colour = ColourView { width: 64, height: 48, data: ColourData::Rgb8(&rgb8), intrinsics: good.intrinsics };
    assert!(matches!(refuse(good, Some(&colour), &pose), Error::WrongLength { image: "colour", .. }));
    let mut broken = pose;
    broken.translation.vector.y = f64::NAN;
    assert!(matches!(refuse(good, None, &broken), Error::InvalidPose { .. }));
    let stretched = UnitQuaternion::new_unchecked(Quaternion::new(1.1, 0.0, 0.0, 0.0));
    let stretched = Isometry3::from_parts(Translation3::identity(), stretched);
    assert!(matches!(refuse(good, None, &stretched), Error::InvalidPose { .. }));
    for far in [1e6, 1e300] {
        let far = Isometry3::from_parts(Translation3::from(Vector3::new(far, 0.0, 0.0)), pose.rotation);
        assert!(matches!(refuse(good, None, &far), Error::OutOfRange));
    }
}

#[test]
fn the_cap_holds_and_a_frame_goes_in_whole_or_not_at_all() {
    let shot = wall();
    let roomy = map_of(&shot);
    let tight = Settings { voxel_size: 0.02, max_bytes: roomy.bytes() - 1, ..Settings::default() };
    for threads in 1..=3 {
        let mut map = Map::new(Settings { threads, ..tight }).unwrap();
        let before = map.hash();
        let error = map.integrate(&shot.view(), None, &shot.world_from_camera).unwrap_err();
        assert!(matches!(error, Error::OutOfBudget { .. }));
        assert_eq!((map.hash(), map.blocks()), (before, 0));
    }
    // A cap of a few dozen blocks, approached by a camera that turns.
    let mut map = Map::new(Settings { max_bytes: 600_000, ..tight }).unwrap();
    let mut refused = 0;
    for k in 0..12 {
        let turned = Isometry3::rotation(Vector3::z() * (0.3 * f64::from(k))) * shot.world_from_camera;
        let before = (map.hash(), map.bytes());
        if map.integrate(&shot.view(), None, &turned).is_err() {
            refused += 1;
            assert_eq!((map.hash(), map.bytes()), before);
        }
        assert!(map.bytes() <= 600_000);
    }
    assert!((1..12).contains(&refused));
}

#[test]
fn a_full_voxel_is_an_error_and_not_a_wrong_average() {
    let shot = wall();
    let mut map = Map::new(Settings { voxel_size: 0.04, ..Settings::default() }).unwrap();
    let rgb8 = vec![255; 3 * 3072];
    let colour = ColourView { width: 64, height: 48, data: ColourData::Rgb8(&rgb8), intrinsics: shot.intrinsics };
    for _ in 0..1040 {
        map.integrate(&shot.view(), Some(&colour), &shot.world_from_camera).unwrap();
    }
    let before = map.hash();
    let error = map.integrate(&shot.view(), Some(&colour), &shot.world_from_camera).unwrap_err();
    assert!(matches!(error, Error::Saturated { .. }));
    assert_eq!(map.hash(), before);
    assert!(map.mesh().colours.iter().all(|c| *c == [255; 3]));
    // Depth alone still fits.
    map.integrate(&shot.view(), None, &shot.world_from_camera).unwrap();
}

/// Sums of the voxels of a block; nothing where there is none.
fn sums(map: &Map, block: [i32; 3]) -> Vec<[i64; 3]> {
    let (reader, mut scratch) = (map.read_blocks(&mut std::iter::once(block)).unwrap(), VoxelBlock::ZERO);
    let block = reader.block(block, &mut scratch).unwrap().unwrap_or(&VoxelBlock::ZERO).clone();
    let of = |(distance, weight, colour): (i32, u16, [u16; 4])| [distance.into(), weight.into(), colour[3].into()];
    (0..512).map(|voxel| of(block.sums(voxel).unwrap())).collect()
}

/// A camera that looks at one place for long, and then beside it: what is full takes nothing, all else does, and frames are taken out again
/// from where they went.
#[test]
fn a_full_block_does_not_keep_a_frame_from_others() {
    let shot = wall();
    let rgb8 = vec![255; 3 * 3072];
    let colour = ColourView { width: 64, height: 48, data: ColourData::Rgb8(&rgb8), intrinsics: shot.intrinsics };
    let beside = Isometry3::translation(0.0, 0.5, 0.0) * shot.world_from_camera;
    for threads in [1, 3] {
        let settings = Settings { voxel_size: 0.04, threads, ..Settings::default() };
        let (mut map, mut full) = (Map::new(settings).unwrap(), vec![[7; 3]]);
        for _ in 0..1040 {
            map.integrate_where_room(&shot.view(), Some(&colour), &shot.world_from_camera, &mut full).unwrap();
            assert!(full.is_empty());
        }
        let before = map.hash();
        let mut all = Vec::new();
        let report = map.integrate_where_room(&shot.view(), Some(&colour), &shot.world_from_camera, &mut all).unwrap();
        assert!(!all.is_empty() && map.mesh().colours.iter().all(|c| *c == [255; 3]), "{report:?}");
        map.deintegrate_except(&shot.view(), Some(&colour), &shot.world_from_camera, &all).unwrap();
        assert_eq!(map.hash(), before);

        let mut alone = Map::new(settings).unwrap();
        let wanted = alone.integrate(&shot.view(), Some(&colour), &beside).unwrap();
        let blocks = alone.changes_since(None).changed;
        let old: Vec<_> = blocks.iter().map(|block| sums(&map, *block)).collect();
        let report = map.integrate_where_room(&shot.view(), Some(&colour), &beside, &mut full).unwrap();
        assert!(!full.is_empty() && report.blocks_added > 0, "{report:?}");
        assert_eq!(report.blocks + full.len(), wanted.blocks);
        for (block, old) in blocks.iter().zip(old) {
            let (new, seen, room) = (sums(&map, *block), sums(&alone, *block), i64::from(!full.contains(block)));
            for (voxel, new) in new.iter().enumerate() {
                assert_eq!(*new, std::array::from_fn(|k| old[voxel][k] + room * seen[voxel][k]), "{block:?}");
            }
        }
        map.deintegrate_except(&shot.view(), Some(&colour), &beside, &full).unwrap();
        assert_eq!(map.hash(), before);
    }
}

#[test]
fn a_stranger_cannot_be_taken_out() {
    let shot = wall();
    let mut map = map_of(&shot);
    let before = map.hash();
    let moved = Isometry3::translation(0.0, 0.0, 0.3) * shot.world_from_camera;
    let turned = Isometry3::rotation(Vector3::z() * 1.0) * shot.world_from_camera;
    for pose in [moved, turned] {
        assert!(matches!(map.deintegrate(&shot.view(), None, &pose), Err(Error::NotIntegrated { .. })));
        assert_eq!(map.hash(), before);
    }
    let rgb8 = vec![9; 3 * 3072];
    let colour = ColourView { width: 64, height: 48, data: ColourData::Rgb8(&rgb8), intrinsics: shot.intrinsics };
    let coloured = map.deintegrate(&shot.view(), Some(&colour), &shot.world_from_camera);
    assert!(matches!(coloured, Err(Error::NotIntegrated { .. })));
    assert_eq!(map.hash(), before);
    map.deintegrate(&shot.view(), None, &shot.world_from_camera).unwrap();
    assert!(map.deintegrate(&shot.view(), None, &shot.world_from_camera).is_err() && map.blocks() == 0);
}

/// 65535 means "no depth" at every scale: with 20000 units per metre it would be a surface at 3.28 m.
#[test]
fn the_largest_integer_is_no_depth() {
    let mut shot = wall();
    shot.depth.iter_mut().for_each(|z| *z += 1.0);
    let mut units: Vec<u16> = shot.depth.iter().map(|z| (20_000.0 * z) as u16).collect();
    // The right half of the image.
    (0..48).for_each(|row| units[64 * row + 32..64 * (row + 1)].fill(u16::MAX));
    let view = DepthView { data: DepthData::U16 { data: &units, scale: 20_000.0 }, ..shot.view() };
    let mut map = Map::new(Settings { voxel_size: 0.02, ..Settings::default() }).unwrap();
    let report = map.integrate(&view, None, &shot.world_from_camera).unwrap();
    assert_eq!(report.valid_pixels, 32 * 48);
    assert!(report.fused_pixels <= 32 * 48);
    assert!(map.mesh().positions.iter().all(|p| Point3::from(p.map(f64::from)).coords.norm() < 3.0));
}
