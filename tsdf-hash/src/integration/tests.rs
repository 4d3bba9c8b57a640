//! The update and the block selection against slow ones that are written voxel by voxel.

use nalgebra::{Isometry3, Point3, Vector3};

use crate::blocks::block_key::BlockKey;
use crate::blocks::voxel_block::{SIDE, VOXELS, VoxelBlock};
use crate::hashing::mix64;
use crate::images::{ColourData, ColourView, DepthData, DepthView, Intrinsics};
use crate::integration::integrator::{Frame, Operation};
use crate::integration::plane_image::PlaneImage;
use crate::settings::Settings;

/// No whole number of vector registers.
const SIZE: (usize, usize) = (91, 71);

/// A ramp, a step and a bowl with noise, gaps, and values that mean "no depth".
fn depths(seed: u64) -> Vec<u16> {
    (0..SIZE.0 * SIZE.1)
        .map(|k| {
            let (u, v) = ((k % SIZE.0) as f64, (k / SIZE.0) as f64);
            let bowl = 0.00008 * ((u - 40.0).powi(2) + (v - 20.0).powi(2));
            let z = 0.75 + 0.003 * u + if v > 45.0 { 0.3 } else { bowl };
            match mix64(seed ^ k as u64) % 500 {
                0 => 0,
                1 => u16::MAX,
                noise => (1000.0 * z + noise as f64 / 250.0) as u16,
            }
        })
        .collect()
}

/// To even at a tie, for the pixels that a `f32` can hold.
fn round(x: f32) -> f32 {
    x.round_ties_even()
}

/// The documented order of operations, one voxel at a time, over the whole block.
fn slow(frame: &Frame, plane_image: &PlaneImage, colour: &ColourView, key: BlockKey, block: &mut VoxelBlock) -> usize {
    let mut touched = 0;
    let h = frame.voxel_size;
    let centre = Vector3::from(key.block()).map(|c| (f64::from(c) * 8.0 + 0.5) * h);
    let start = (frame.projection * centre + frame.offset).cast::<f32>();
    let step = (frame.projection * h).cast::<f32>();
    for voxel in 0..VOXELS {
        let [x, y, z] = [voxel % SIDE, voxel / SIDE % SIDE, voxel / (SIDE * SIDE)].map(|c| c as f32);
        let p = [0, 1, 2].map(|k| ((start[k] + step[(k, 1)] * y) + step[(k, 2)] * z) + step[(k, 0)] * x);
        let r = 1.0 / p[2];
        let (u, v) = (p[0] * r, p[1] * r);
        let (i, j) = (round(u), round(v));
        if !(p[2] > 0.0 && (0.0..SIZE.0 as f32).contains(&i) && (0.0..SIZE.1 as f32).contains(&j)) {
            continue;
        }
        let plane = plane_image.planes[i as usize + SIZE.0 * j as usize];
        let own = p[2] * plane.scaled_omega;
        let [least, most] = frame.reach.map(|reach| reach * plane.scaled_omega);
        let rim = plane_image.rims.rims[i as usize + SIZE.0 * j as usize];
        let ahead = rim.depth() - p[2];
        let beside = rim.pixels() > 0 && (frame.rim_reach[0]..=frame.rim_reach[1]).contains(&ahead);
        let within = plane.offset - own <= most;
        if plane.scaled_omega == 0.0 || plane.offset - own < least || !(within || beside) {
            continue;
        }
        touched += 1;
        let [slope_u, slope_v] = plane.scaled_slope;
        let q = plane.offset - p[2] * (plane.scaled_omega + (slope_u * (u - i) + slope_v * (v - j)));
        let w = slope_v.to_bits() & 15;
        assert!((1..=15).contains(&w));
        let coloured = within && q.abs() < frame.colour_reach;
        let aside = (rim.pixels() as f32 - 0.5) * frame.pixel * rim.depth();
        let q = if beside { q.min((aside - frame.half_voxel).max(ahead).max(0.0) * frame.per_metre) } else { q };
        let q = round(q.clamp(-32767.0, 32767.0)) as i32;
        // From 4096 steps behind on, less by a share of seven 65536ths for each, rounded to even at a tie.
        let left = f64::from(w) * (1.0 + f64::from((q + 4096).min(0)) * 7.0 / 65536.0);
        let w = left.max(1.0).round_ties_even() as i32;
        block.distance[voxel] += q * w;
        block.weight[voxel] += w as u16;
        // The colour image may have another size; its camera stands in the same place.
        let k = &colour.intrinsics;
        let camera = [(f64::from(u) - CAMERA.cx) / CAMERA.fx, (f64::from(v) - CAMERA.cy) / CAMERA.fy];
        let pixel = [k.fx * camera[0] + k.cx, k.fy * camera[1] + k.cy];
        let inside = (-0.5..colour.width as f64 - 0.5).contains(&pixel[0])
            && (-0.5..colour.height as f64 - 0.5).contains(&pixel[1]);
        if coloured && inside {
            let at = 3 * (pixel[0].round() as usize + colour.width * pixel[1].round() as usize);
            let six = |c: usize| match colour.data {
                ColourData::Rgb8(data) => (f64::from(data[at + c]) * 63.0 / 255.0).round() as u16,
                ColourData::Rgb16(data) => (f64::from(data[at + c]) * 63.0 / 65535.0).round() as u16,
            };
            for (sum, c) in block.colour[voxel].iter_mut().zip([six(0), six(1), six(2), 1]) {
                *sum += c;
            }
        }
    }
    touched
}

const CAMERA: Intrinsics = Intrinsics { fx: 85.0, fy: -80.0, cx: 46.3, cy: 37.2 };

/// Every bit of every block in a large box around the scene, so that nothing that is skipped may matter.
#[test]
fn the_fast_update_equals_the_documented_one() {
    let wide: Vec<u16> = (0..3 * 150 * 40).map(|k| mix64(k) as u16).collect();
    let registered: Vec<u8> = (0..3 * SIZE.0 * SIZE.1).map(|k| mix64(k as u64) as u8).collect();
    // Twice as fine across and half as fine down, cut on all sides; factors that a f32 holds exactly.
    let other = Intrinsics { fx: 170.0, fy: -40.0, cx: 80.0, cy: 16.0 };
    for (seed, h, look, carve) in [(1, 0.02, 0.0, 0.0), (2, 0.005, 0.7, 0.0), (3, 0.04, -2.1, 0.0), (4, 0.03, 0.4, 0.5)]
    {
        let data = depths(seed);
        let data = DepthData::U16 { data: &data, scale: 1000.0 };
        let depth = DepthView { width: SIZE.0, height: SIZE.1, data, intrinsics: CAMERA };
        let colour = match seed {
            1 => ColourView { width: SIZE.0, height: SIZE.1, data: ColourData::Rgb8(&registered), intrinsics: CAMERA },
            _ => ColourView { width: 150, height: 40, data: ColourData::Rgb16(&wide), intrinsics: other },
        };
        let settings = Settings { voxel_size: h, carve, min_depth: 0.3, ..Settings::default() };
        let pose = Isometry3::new(Vector3::new(0.05, -0.02, 0.1), Vector3::new(0.3, look, 0.2));
        let mut plane_image = PlaneImage::default();
        plane_image.read(&depth, &pose, &settings).unwrap();
        let frame = Frame::new(&plane_image, &CAMERA, Some(&colour), &pose, &settings);
        let (mut total, mut coloured) = (0, 0);
        // Around a point in the middle of the view; some blocks lie behind the camera.
        let middle = pose * Point3::new(0.0, 0.0, 0.9);
        let reach = (0.6 / (8.0 * h)).ceil().min(14.0) as i32;
        let side = 2 * reach + 1;
        for n in 0..side.pow(3) {
            let offset = [n % side - reach, n / side % side - reach, n / (side * side) - reach];
            let base = middle.coords.map(|c| (c / (8.0 * h)).floor() as i32);
            let key = BlockKey::new([0, 1, 2].map(|k| base[k] + offset[k])).unwrap();
            let (mut fast, mut expected) = (VoxelBlock::ZERO, VoxelBlock::ZERO);
            let count = frame.apply(Operation::Integrate, key, &mut fast);
            let touched = slow(&frame, &plane_image, &colour, key, &mut expected);
            assert!(count.voxels == touched && !count.overflow);
            assert!(fast == expected, "block {:?} of scene {seed}", key.block());
            assert!(!frame.apply(Operation::Deintegrate, key, &mut fast).overflow && fast == VoxelBlock::ZERO);
            total += touched;
            coloured += expected.colour.iter().filter(|c| c[3] > 0).count();
        }
        assert!(
            total > 3000 && coloured > total / if carve > 0.0 { 30 } else { 8 },
            "{total} voxels, {coloured} coloured"
        );
    }
}

/// Taking out what was never in is noticed in every counter.
#[test]
fn a_counter_below_zero_is_a_fault() {
    let data = vec![1.0; SIZE.0 * SIZE.1];
    let depth = DepthView { width: SIZE.0, height: SIZE.1, data: DepthData::F32 { data: &data }, intrinsics: CAMERA };
    let red: Vec<u8> = (0..3 * SIZE.0 * SIZE.1).map(|k| if k % 3 == 0 { 255 } else { 0 }).collect();
    let colour = ColourView { width: SIZE.0, height: SIZE.1, data: ColourData::Rgb8(&red), intrinsics: CAMERA };
    let settings = Settings { voxel_size: 0.02, ..Settings::default() };
    let mut plane_image = PlaneImage::default();
    let pose = Isometry3::identity();
    plane_image.read(&depth, &pose, &settings).unwrap();
    let frame = Frame::new(&plane_image, &CAMERA, Some(&colour), &pose, &settings);
    let key = plane_image.keys.iter().copied().find(|key| key.block() == [0, 0, 6]).unwrap();
    let mut full = VoxelBlock::ZERO;
    assert!(!frame.apply(Operation::Integrate, key, &mut full).overflow);
    let at = full.colour.iter().position(|c| c[3] > 0).unwrap();
    let spoils: [fn(&mut VoxelBlock, usize); 4] = [
        |b, at| b.weight[at] -= 1,
        |b, at| b.distance[at] += 32767 * 20,
        |b, at| b.colour[at][0] -= 1,
        |b, at| b.colour[at][3] -= 1,
    ];
    for spoil in spoils {
        let mut block = full.clone();
        spoil(&mut block, at);
        let spoiled = block.clone();
        assert!(frame.apply(Operation::Deintegrate, key, &mut block).overflow);
        frame.apply(Operation::Integrate, key, &mut block);
        assert!(block == spoiled, "the opposite update restores every bit");
    }
}

/// Brute force: the frame is applied to every block of a large box around the scene.
#[test]
fn no_touched_block_is_missed() {
    // A ramp with a step, seen from oblique poses by cameras of either handedness.
    let data: Vec<f32> =
        (0..80 * 60).map(|k| 0.9 + 0.004 * (k % 80) as f32 + if k / 80 > 30 { 0.35 } else { 0.0 }).collect();
    // With the larger voxels, rims are told.
    for (threads, fx, fy, carve, voxel_size) in [
        (1, 70.0, 70.0, 0.0, 0.01),
        (2, 60.0, -75.0, 0.0, 0.01),
        (3, -65.0, 80.0, 0.0, 0.01),
        (2, 65.0, 70.0, 0.6, 0.01),
        (2, 70.0, -70.0, 0.0, 0.03),
    ] {
        let settings = Settings { voxel_size, carve, threads, ..Settings::default() };
        let intrinsics = Intrinsics { fx, fy, cx: 38.3, cy: 31.7 };
        let view = DepthView { width: 80, height: 60, data: DepthData::F32 { data: &data }, intrinsics };
        let pose = Isometry3::new(Vector3::new(0.05, -0.02, -1.0), Vector3::new(0.3, -0.4, 0.2 * fx / 60.0));
        let mut plane_image = PlaneImage::default();
        plane_image.read(&view, &pose, &settings).unwrap();
        assert_eq!(plane_image.rims.beside.is_empty(), voxel_size < 0.02);
        let frame = Frame::new(&plane_image, &intrinsics, None, &pose, &settings);
        let (mut touched, mut blank) = (0, VoxelBlock::ZERO);
        for n in 0..48_i32.pow(3) {
            let key = BlockKey::new([n % 48 - 24, n / 48 % 48 - 24, n / 2304 - 24]).unwrap();
            if frame.apply(Operation::Integrate, key, &mut blank).voxels > 0 {
                touched += 1;
                assert!(plane_image.keys.binary_search(&key).is_ok(), "{:?} was missed", key.block());
            }
        }
        // Enough blocks, and a search that is not just everything.
        let least = if voxel_size < 0.02 { 100 } else { 20 };
        assert!(touched > least && plane_image.keys.len() < 3 * touched, "{touched} of {}", plane_image.keys.len());
    }
}
