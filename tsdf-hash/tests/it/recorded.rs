//! Recordings in the formats of public data sets: small ones of our own, written by the tests, and the real ones where
//! `PAINTCOPTER_DATA` names a folder that has them. With `PAINTCOPTER_REQUIRE_DATA=1` a missing one is a failure.

use std::path::{Path, PathBuf};

use image::{ImageBuffer, Luma, Rgb};
use nalgebra::{Isometry3, Matrix3, Matrix4, Point3, Quaternion, Rotation3, Translation3, UnitQuaternion, Vector3};
use tsdf_hash::{ColourData, ColourView, DepthData, DepthView, Intrinsics, Map, Settings};

use crate::eviction::scratch;
use crate::scene::{Shot, room};
use crate::topology::assert_manifold;

struct Recorded {
    depth: Vec<u16>,
    rgb8: Vec<u8>,
    world_from_camera: Isometry3<f64>,
}

/// The folder of a real recording; `None`, and a line that says so, where it is missing and not demanded.
fn folder(name: &str) -> Option<PathBuf> {
    let root = std::env::var_os("PAINTCOPTER_DATA").map(PathBuf::from);
    let found = root.map(|root| root.join("rgbd").join(name)).filter(|path| path.is_dir());
    if found.is_none() {
        let demanded = std::env::var_os("PAINTCOPTER_REQUIRE_DATA").is_some_and(|value| value == "1");
        assert!(!demanded, "PAINTCOPTER_REQUIRE_DATA=1, but there is no rgbd/{name} under PAINTCOPTER_DATA");
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

/// 7-Scenes: a matrix per frame, millimetres.
fn read_seven_scenes(dir: &Path, frames: impl Iterator<Item = usize>) -> Vec<Recorded> {
    let read = |k: usize| {
        let path = |end: &str| dir.join(format!("frame-{k:06}.{end}"));
        let pose = pose_from_matrix(&numbers(&std::fs::read_to_string(path("pose.txt")).unwrap()));
        load(&path("depth.png"), &path("color.jpg"), pose)
    };
    frames.map(read).collect()
}

/// ICL-NUIM as slambook2 has it: all poses in one file, `t q` with the quaternion x y z w, a fifth of a millimetre.
fn read_icl_nuim(dir: &Path) -> Vec<Recorded> {
    let poses = std::fs::read_to_string(dir.join("pose.txt")).unwrap();
    let read = |(line, k): (&str, usize)| {
        let p = numbers(line);
        let rotation = UnitQuaternion::from_quaternion(Quaternion::new(p[6], p[3], p[4], p[5]));
        let pose = Isometry3::from_parts(Translation3::new(p[0], p[1], p[2]), rotation);
        load(&dir.join(format!("depth/{k}.png")), &dir.join(format!("color/{k}.png")), pose)
    };
    poses.lines().zip(1..).map(read).collect()
}

/// Redwood: three numbers and a matrix per frame in one log, millimetres.
fn read_redwood(dir: &Path) -> Vec<Recorded> {
    let log = numbers(&std::fs::read_to_string(dir.join("trajectory.log")).unwrap());
    let read = |(k, row): (usize, &[f64])| {
        let depth = dir.join(format!("depth/{k:05}.png"));
        load(&depth, &dir.join(format!("color/{k:05}.jpg")), pose_from_matrix(&row[3..]))
    };
    log.chunks_exact(19).enumerate().map(read).collect()
}

/// The room of the tests, recorded in one of the formats; removed with this.
struct Fixture {
    dir: PathBuf,
    intrinsics: Intrinsics,
}

impl Drop for Fixture {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.dir);
    }
}

impl Fixture {
    /// `names` gives depth and colour files of a frame, `poses` writes the trajectory.
    fn write(
        name: &str,
        focal: [f64; 2],
        scale: f64,
        names: impl Fn(usize) -> [String; 2],
        poses: impl Fn(&Path, &[Isometry3<f64>]),
    ) -> Self {
        let dir = scratch(name);
        for folder in ["depth", "color"] {
            std::fs::create_dir_all(dir.join(folder)).unwrap();
        }
        let mut all = Vec::new();
        let mut intrinsics = None;
        for k in 0..4 {
            let shot = Shot::take((640, 480), focal, room::pose(k, 60), |o, d| Some(room::hit(o, d)));
            // One pixel in a hundred has no depth, by either of the two values that mean so.
            let depth = |at: usize| match at % 200 {
                7 => 0,
                107 => u16::MAX,
                _ => (scale * f64::from(shot.depth[at])).round() as u16,
            };
            let depth = ImageBuffer::from_fn(640, 480, |u, v| Luma([depth((v * 640 + u) as usize)]));
            let colour = ImageBuffer::from_fn(640, 480, |u, v| Rgb([(u / 3) as u8, (v / 2) as u8, 90_u8]));
            let [depth_name, colour_name] = names(k);
            depth.save(dir.join(depth_name)).unwrap();
            colour.save(dir.join(colour_name)).unwrap();
            all.push(shot.world_from_camera);
            intrinsics = Some(shot.intrinsics);
        }
        poses(&dir, &all);
        Self { dir, intrinsics: intrinsics.unwrap() }
    }

    fn check(&self, frames: &[Recorded], scale: f64) {
        let (held_out, fused) = frames.split_last().unwrap();
        for (frame, k) in frames.iter().zip(0..) {
            let off = frame.world_from_camera.inverse() * room::pose(k, 60);
            assert!(off.translation.vector.norm() < 1e-6 && off.rotation.angle() < 1e-6, "frame {k}");
        }
        let map = fuse(fused, scale, self.intrinsics);
        let (median, known) = residual(&map, held_out, scale, &self.intrinsics);
        assert!(median < 1e-3 && known > 0.5, "median {median}, known {known}");
        let mean = |mesh: &tsdf_hash::mesh::Mesh| {
            let error = |p: &[f32; 3]| room::sdf(&Point3::from(p.map(f64::from))).abs();
            mesh.positions.iter().map(error).sum::<f64>() / mesh.positions.len() as f64
        };
        let mesh = map.mesh();
        assert!(mean(&mesh) < 1e-3, "{}", mean(&mesh));
        assert!(mesh.colours.iter().filter(|rgb| **rgb != [128; 3]).count() > mesh.colours.len() / 2);
    }
}

fn rows(pose: &Isometry3<f64>) -> String {
    let m = pose.to_homogeneous();
    let row = |r: usize| format!("{} {} {} {}\n", m[(r, 0)], m[(r, 1)], m[(r, 2)], m[(r, 3)]);
    (0..4).map(row).collect()
}

fn depth_view(frame: &Recorded, scale: f64, intrinsics: Intrinsics) -> DepthView<'_> {
    DepthView { width: 640, height: 480, data: DepthData::U16 { data: &frame.depth, scale }, intrinsics }
}

/// Fuses all frames and checks the mesh.
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
fn recordings_of_our_own_in_three_formats() {
    let seven = Fixture::write(
        "seven-scenes",
        [585.0; 2],
        1000.0,
        |k| [format!("frame-{k:06}.depth.png"), format!("frame-{k:06}.color.jpg")],
        |dir, poses| {
            for (k, pose) in poses.iter().enumerate() {
                std::fs::write(dir.join(format!("frame-{k:06}.pose.txt")), rows(pose)).unwrap();
            }
        },
    );
    seven.check(&read_seven_scenes(&seven.dir, 0..4), 1000.0);
    let icl = Fixture::write(
        "icl-nuim",
        [481.2, -480.0],
        5000.0,
        |k| [format!("depth/{}.png", k + 1), format!("color/{}.png", k + 1)],
        |dir, poses| {
            let line = |pose: &Isometry3<f64>| {
                let (t, q) = (pose.translation.vector, pose.rotation.coords);
                format!("{} {} {} {} {} {} {}\n", t.x, t.y, t.z, q.x, q.y, q.z, q.w)
            };
            std::fs::write(dir.join("pose.txt"), poses.iter().map(line).collect::<String>()).unwrap();
        },
    );
    icl.check(&read_icl_nuim(&icl.dir), 5000.0);
    let redwood = Fixture::write(
        "redwood",
        [525.0; 2],
        1000.0,
        |k| [format!("depth/{k:05}.png"), format!("color/{k:05}.jpg")],
        |dir, poses| {
            let entry = |(k, pose): (usize, &Isometry3<f64>)| format!("{k} {k} {}\n{}", k + 1, rows(pose));
            std::fs::write(dir.join("trajectory.log"), poses.iter().enumerate().map(entry).collect::<String>())
                .unwrap();
        },
    );
    redwood.check(&read_redwood(&redwood.dir), 1000.0);
}

#[test]
fn seven_scenes_kitchen() {
    let Some(dir) = folder("7scenes_redkitchen_000-199") else { return };
    let frames = read_seven_scenes(&dir, (0..60).step_by(10));
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
    let frames = read_icl_nuim(&dir);
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
    let frames = read_redwood(&dir);
    let intrinsics = Intrinsics { fx: 525.0, fy: 525.0, cx: 319.5, cy: 239.5 };
    let map = fuse(&frames[..4], 1000.0, intrinsics);
    let (median, known) = residual(&map, &frames[4], 1000.0, &intrinsics);
    assert!(median < 0.008 && known > 0.6, "median {median}, known {known}");
}
