//! Recorded images. They are found by `PAINTCOPTER_DATA`; without them these tests say so and pass.

use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Matrix3, Matrix4, Point3, Quaternion, Rotation3, Translation3, UnitQuaternion, Vector3};
use tsdf_hash::{ColourData, ColourView, DepthData, DepthView, Intrinsics, Map, Settings};

use crate::topology::assert_manifold;

struct Recorded {
    depth: Vec<u16>,
    rgb8: Vec<u8>,
    world_from_camera: Isometry3<f64>,
}

fn folder(name: &str) -> Option<PathBuf> {
    let default = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data");
    let root = std::env::var_os("PAINTCOPTER_DATA").map_or(default, PathBuf::from);
    let found = Some(root.join("rgbd").join(name)).filter(|path| path.is_dir());
    if found.is_none() {
        eprintln!("SKIPPED: no rgbd/{name} under PAINTCOPTER_DATA");
    }
    found
}

fn load(depth: &Path, colour: &Path, world_from_camera: Isometry3<f64>) -> Recorded {
    let depth = image::open(depth).unwrap().into_luma16();
    let rgb8 = image::open(colour).unwrap().into_rgb8();
    assert!(depth.dimensions() == (640, 480) && rgb8.dimensions() == (640, 480));
    Recorded { depth: depth.into_raw(), rgb8: rgb8.into_raw(), world_from_camera }
}

fn numbers(text: &str) -> Vec<f64> {
    text.split_whitespace().map(|word| word.parse().unwrap()).collect()
}

/// From a row-major 4x4, whose rotation is orthogonal to a few digits only.
fn pose_from_matrix(rows: &[f64]) -> Isometry3<f64> {
    let m = Matrix4::from_row_slice(rows);
    let rotation = Matrix3::from(m.fixed_view::<3, 3>(0, 0));
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix(&rotation));
    Isometry3::from_parts(Translation3::new(m[(0, 3)], m[(1, 3)], m[(2, 3)]), rotation)
}

fn depth_view(frame: &Recorded, scale: f64, intrinsics: Intrinsics) -> DepthView<'_> {
    DepthView { width: 640, height: 480, data: DepthData::U16 { data: &frame.depth, scale }, intrinsics }
}

/// Fuses all frames, checks the mesh and takes everything out again; returns the full map.
fn fuse(frames: &[Recorded], scale: f64, intrinsics: Intrinsics) -> Map {
    let mut map = Map::new(Settings { voxel_size: 0.02, threads: 2, ..Settings::default() }).unwrap();
    for frame in frames {
        let colour = ColourView { width: 640, height: 480, data: ColourData::Rgb8(&frame.rgb8), intrinsics };
        map.integrate(&depth_view(frame, scale, intrinsics), Some(&colour), &frame.world_from_camera).unwrap();
    }
    let mesh = map.mesh();
    assert!(mesh.faces.len() > 10_000);
    assert_manifold(&mesh);
    map
}

/// Median of |distance| over the points of a frame that the map knows, and how many of them it knows.
fn residual(map: &Map, frame: &Recorded, scale: f64, k: &Intrinsics) -> (f64, f64) {
    let (mut known, mut asked) = (Vec::new(), 0);
    for at in (0..640 * 480).step_by(37).filter(|&at| frame.depth[at] != 0) {
        let z = f64::from(frame.depth[at]) / scale;
        if !(0.3..4.0).contains(&z) {
            continue;
        }
        let ray = Vector3::new(((at % 640) as f64 - k.cx) / k.fx, ((at / 640) as f64 - k.cy) / k.fy, 1.0);
        asked += 1;
        known.extend(map.distance(&(frame.world_from_camera * Point3::from(ray * z))).map(f64::abs));
    }
    known.sort_by(f64::total_cmp);
    (known[known.len() / 2], known.len() as f64 / f64::from(asked))
}

#[test]
fn seven_scenes_kitchen() {
    let Some(dir) = folder("7scenes_redkitchen_000-199") else { return };
    let frames: Vec<_> = (0..60)
        .step_by(10)
        .map(|k| {
            let path = |end: &str| dir.join(format!("frame-{k:06}.{end}"));
            let pose = pose_from_matrix(&numbers(&std::fs::read_to_string(path("pose.txt")).unwrap()));
            load(&path("depth.png"), &path("color.jpg"), pose)
        })
        .collect();
    let intrinsics = Intrinsics { fx: 585.0, fy: 585.0, cx: 320.0, cy: 240.0 };
    let (held_out, fused) = frames.split_last().unwrap();
    let map = fuse(fused, 1000.0, intrinsics);
    let (median, known) = residual(&map, held_out, 1000.0, &intrinsics);
    // The poses are good to about a centimetre.
    assert!(median < 0.015 && known > 0.6, "median {median}, known {known}");
}

#[test]
fn icl_living_room_has_a_negative_focal_length() {
    let Some(dir) = folder("icl_nuim_livingroom_slambook2_ch12") else { return };
    let poses = std::fs::read_to_string(dir.join("pose.txt")).unwrap();
    let frames: Vec<_> = poses
        .lines()
        .zip(1..)
        .map(|(line, k)| {
            let p = numbers(line);
            let rotation = UnitQuaternion::from_quaternion(Quaternion::new(p[6], p[3], p[4], p[5]));
            let pose = Isometry3::from_parts(Translation3::new(p[0], p[1], p[2]), rotation);
            load(&dir.join(format!("depth/{k}.png")), &dir.join(format!("color/{k}.png")), pose)
        })
        .collect();
    let measured = [-480.0, 480.0].map(|fy| {
        let intrinsics = Intrinsics { fx: 481.2, fy, cx: 319.5, cy: 239.5 };
        let map = fuse(&frames[1..], 5000.0, intrinsics);
        residual(&map, &frames[0], 5000.0, &intrinsics)
    });
    let [(right, known_right), (_, known_wrong)] = measured;
    assert!(right < 0.012, "{measured:?}");
    // With the wrong sign the frame does not meet what the others saw.
    assert!(known_right > 2.0 * known_wrong, "{measured:?}");
}

#[test]
fn redwood_frames_agree() {
    let Some(dir) = folder("redwood_open3d_RGBD") else { return };
    let log = numbers(&std::fs::read_to_string(dir.join("trajectory.log")).unwrap());
    let frames: Vec<_> = log
        .chunks_exact(19)
        .enumerate()
        .map(|(k, row)| {
            let depth = dir.join(format!("depth/{k:05}.png"));
            load(&depth, &dir.join(format!("color/{k:05}.jpg")), pose_from_matrix(&row[3..]))
        })
        .collect();
    let intrinsics = Intrinsics { fx: 525.0, fy: 525.0, cx: 319.5, cy: 239.5 };
    let map = fuse(&frames[..4], 1000.0, intrinsics);
    let (median, known) = residual(&map, &frames[4], 1000.0, &intrinsics);
    assert!(median < 0.008 && known > 0.6, "median {median}, known {known}");
}
