//! Recorded sequences: the layouts say the same in different words, and what is wrong is named.

use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;

use image::{ImageBuffer, Luma, Rgb};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use paintcopter::scan::{Scan, ScanSettings, open_sequence};
use tsdf_hash::slam::{PoseSource, SlamSettings};

use crate::scratch::Scratch;

const SIZE: (u32, u32) = (96, 72);
/// Camera of the pictures: width 96 pixels, 70 degrees.
const CAMERA: [f64; 4] = [68.0, 68.0, 47.5, 35.5];
/// Where the wall is, metres in the world's z.
const WALL: f64 = 1.5;

/// Depth of the wall from a pose without rotation about x or y, and a red picture.
fn images(s: &Scratch, depth: &str, colour: &str, metres: f64, scale: f64) {
    for name in [depth, colour] {
        std::fs::create_dir_all(s.0.join(name).parent().unwrap()).unwrap();
    }
    let value = (metres * scale).round() as u16;
    ImageBuffer::from_pixel(SIZE.0, SIZE.1, Luma([value])).save(s.0.join(depth)).unwrap();
    ImageBuffer::from_pixel(SIZE.0, SIZE.1, Rgb([200_u8, 20, 20])).save(s.0.join(colour)).unwrap();
}

/// Three poses before the wall: aside, nearer, and rolled.
fn poses() -> [Isometry3<f64>; 3] {
    [(0.0, 0.0, 0.0), (0.1, 0.25, 0.0), (-0.1, 0.0, 0.3)].map(|(x, z, roll)| {
        let rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), roll);
        Isometry3::from_parts(Translation3::new(x, 0.02, z), rotation)
    })
}

fn matrix(pose: &Isometry3<f64>) -> String {
    pose.to_homogeneous().row_iter().fold(String::new(), |mut text, row| {
        writeln!(text, "{} {} {} {}", row[0], row[1], row[2], row[3]).unwrap();
        text
    })
}

fn quaternion(pose: &Isometry3<f64>) -> String {
    let (t, q) = (pose.translation.vector, pose.rotation.quaternion());
    format!("{} {} {} {} {} {} {}", t.x, t.y, t.z, q.i, q.j, q.k, q.w)
}

fn seven_scenes(s: &Scratch) {
    let [fx, fy, cx, cy] = CAMERA;
    s.write("camera-intrinsics.txt", format!("{fx} 0 {cx}\n0 {fy} {cy}\n0 0 1\n"));
    for (k, pose) in poses().iter().enumerate() {
        let name = |ending: &str| format!("frame-{k:06}.{ending}");
        images(s, &name("depth.png"), &name("color.png"), WALL - pose.translation.z, 1000.0);
        s.write(&name("pose.txt"), matrix(pose));
    }
}

fn tum(s: &Scratch) {
    let [fx, fy, cx, cy] = CAMERA;
    s.write("intrinsics.txt", format!("{} {} {fx} {fy} {cx} {cy} 1000\n", SIZE.0, SIZE.1));
    let (mut depth, mut colour, mut truth) = (String::from("# list\n"), String::new(), String::new());
    for (k, pose) in poses().iter().enumerate() {
        let (d, c) = (format!("depth/{k}.png"), format!("rgb/{k}.png"));
        images(s, &d, &c, WALL - pose.translation.z, 1000.0);
        let stamp = 100.0 + 0.1 * k as f64;
        writeln!(depth, "{stamp} {d}").unwrap();
        // The colour camera is a little late.
        writeln!(colour, "{} {c}", stamp + 0.01).unwrap();
        writeln!(truth, "{stamp} {}", quaternion(pose)).unwrap();
    }
    s.write("depth.txt", &depth);
    s.write("rgb.txt", &colour);
    s.write("groundtruth.txt", &truth);
}

fn redwood(s: &Scratch) {
    let [fx, fy, cx, cy] = CAMERA;
    s.write("camera_primesense.json", format!("{{\"intrinsic_matrix\":[{fx},0,0,0,{fy},0,{cx},{cy},1]}}"));
    let mut log = String::new();
    for (k, pose) in poses().iter().enumerate() {
        images(s, &format!("depth/{k:05}.png"), &format!("color/{k:05}.png"), WALL - pose.translation.z, 1000.0);
        write!(log, "{k} {k} {}\n{}", k + 1, matrix(pose)).unwrap();
    }
    s.write("trajectory.log", &log);
}

fn run(folder: &Path, threads: usize) -> Scan {
    let sequence = open_sequence(folder).unwrap();
    let map = tsdf_hash::Settings { voxel_size: 0.02, threads, ..tsdf_hash::Settings::default() };
    let slam = SlamSettings { map, poses: PoseSource::Given, ..SlamSettings::default() };
    Scan::run(folder, &sequence, &ScanSettings { slam, ray_cast_every: 1, ..ScanSettings::default() }).unwrap()
}

#[test]
fn three_layouts_give_the_same_wall() {
    type Layout = (&'static str, fn(&Scratch));
    let layouts: [Layout; 3] = [("7-Scenes", seven_scenes), ("TUM", tum), ("Redwood", redwood)];
    for (layout, write) in layouts {
        let s = Scratch::new(layout);
        write(&s);
        let sequence = open_sequence(&s.0).unwrap();
        assert_eq!(sequence.layout, layout);
        for (frame, expected) in sequence.frames.iter().zip(poses()) {
            let error = frame.world_from_camera.unwrap().inverse() * expected;
            assert!(error.translation.vector.norm() + error.rotation.angle() < 1e-9, "{layout}: {error}");
        }
        let scan = run(&s.0, 1);
        assert_eq!((scan.fused.len(), scan.skipped.len()), (3, 0), "{layout}");
        assert!(scan.mesh.faces.len() > 1000, "{layout}: {} faces", scan.mesh.faces.len());
        for (position, colour) in scan.mesh.positions.iter().zip(&scan.mesh.colours) {
            assert!((f64::from(position[2]) - WALL).abs() < 1e-3, "{layout}: {position:?}");
            // Six bits per channel.
            assert!(colour[0].abs_diff(200) <= 4 && colour[1].abs_diff(20) <= 4, "{layout}: {colour:?}");
        }
        for cast in &scan.metrics.ray_casts {
            assert!(cast.depth.mean_error < 1e-3 && cast.depth.fill > 0.8, "{layout}: {cast:?}");
        }
        assert_eq!(scan.metrics.ray_casts.len(), 3, "{layout}");
        assert_eq!(scan.state.map.hash(), run(&s.0, 3).state.map.hash(), "{layout}");
    }
}

#[test]
fn icl_has_its_y_upwards() {
    let s = Scratch::new("icl");
    let mut lines = String::new();
    for k in 1..=2 {
        // Only the upper half of the picture has depth.
        images(&s, &format!("depth/{k}.png"), &format!("color/{k}.png"), WALL, 5000.0);
        let path = s.0.join(format!("depth/{k}.png"));
        let mut depth = image::open(&path).unwrap().into_luma16();
        depth.enumerate_pixels_mut().filter(|(_, y, _)| *y >= SIZE.1 / 2).for_each(|(_, _, p)| p.0 = [0]);
        depth.save(&path).unwrap();
        writeln!(lines, "{}", quaternion(&Isometry3::identity())).unwrap();
    }
    s.write("pose.txt", &lines);
    // Centre of the published camera: row 239.5, so every row of this small picture lies above it, and above is +y.
    let scan = run(&s.0, 1);
    let lowest = scan.mesh.positions.iter().map(|p| p[1]).fold(f32::MAX, f32::min);
    let expected = (239.5 - 36.0) / 480.0 * WALL;
    assert!((f64::from(lowest) - expected).abs() < 0.05, "{lowest} against {expected}");
}

#[test]
fn what_is_wrong_is_named() {
    let refused = |s: &Scratch, words: &[&str]| {
        let out = s.0.join("out");
        let output = Command::new(env!("CARGO_BIN_EXE_scan"))
            .arg("--sequence")
            .arg(&s.0)
            .arg("--out")
            .arg(&out)
            .output()
            .unwrap();
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(1), "{text}");
        assert!(!text.contains("panicked") && !out.join("report.json").exists(), "{text}");
        let line = text.lines().find(|l| l.starts_with("scan: ")).unwrap_or_else(|| panic!("no error line: {text}"));
        for word in words {
            assert!(line.contains(word), "\"{word}\" is missing in: {line}");
        }
    };
    let case = |name: &str, spoil: &dyn Fn(&Scratch), words: &[&str]| {
        let s = Scratch::new(name);
        seven_scenes(&s);
        spoil(&s);
        refused(&s, words);
    };
    refused(&Scratch::new("empty"), &["no sequence found", "depth.txt"]);
    case(
        "skewed",
        &|s| s.write("frame-000001.pose.txt", "1 0.1 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n"),
        &["frame-000001.pose.txt", "not a rotation"],
    );
    case("short", &|s| s.write("frame-000001.pose.txt", "1 0 0\n"), &["frame-000001.pose.txt", "4x4", "3"]);
    case("words", &|s| s.write("frame-000002.pose.txt", "one"), &["frame-000002.pose.txt", "line 1", "one"]);
    case("camera", &|s| s.write("camera-intrinsics.txt", "1 2"), &["camera-intrinsics.txt", "3x3"]);
    case(
        "unplaced",
        &|s| (0..3).for_each(|k| std::fs::remove_file(s.0.join(format!("frame-00000{k}.pose.txt"))).unwrap()),
        &["none of the 3 frames", "no pose"],
    );
    case(
        "damaged",
        &|s| (0..3).for_each(|k| s.write(&format!("frame-00000{k}.depth.png"), "PNG")),
        &["none of the 3 frames", "frame-000000.depth.png", "cannot be read"],
    );
    let s = Scratch::new("unsorted");
    tum(&s);
    s.write("depth.txt", "2 depth/0.png\n1 depth/1.png\n");
    refused(&s, &["depth.txt", "line 2", "sort"]);
}

#[test]
fn one_damaged_frame_is_left_out_and_counted() {
    let s = Scratch::new("one");
    seven_scenes(&s);
    s.write("frame-000001.depth.png", "no picture");
    let scan = run(&s.0, 1);
    let fused: Vec<usize> = scan.fused.iter().map(|(index, _)| *index).collect();
    assert_eq!((fused, scan.skipped.len()), (vec![0, 2], 1));
    assert!(scan.skipped[0].1.contains("frame-000001.depth.png"), "{}", scan.skipped[0].1);
}

/// The recording that a newcomer can try is one: mapped with its poses, and without.
#[test]
fn a_simulated_recording_is_mapped() {
    let s = Scratch::new("scan-sim");
    let (recording, out) = (s.path("recording"), s.path("out"));
    let scan = |arguments: &[&str]| {
        let output = Command::new(env!("CARGO_BIN_EXE_scan")).args(arguments).output().unwrap();
        assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    };
    scan(&["sim", "--seconds", "1", "--out", &recording]);
    for poses in ["given", "tracked"] {
        scan(&["--sequence", &recording, "--poses", poses, "--voxel", "0.03", "--out", &out]);
        let report = std::fs::read_to_string(format!("{out}/report.json")).unwrap();
        let report: serde_json::Value = serde_json::from_str(&report).unwrap();
        assert_eq!(
            (&report["fused_share"], &report["frames_skipped"]),
            (&1.0.into(), &0.into()),
            "{poses}: {report:#}"
        );
        if poses == "tracked" {
            assert!(report["ate_se3_rmse_m"].as_f64().unwrap() < 0.01, "{report:#}");
        }
    }
}
