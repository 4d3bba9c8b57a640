//! Recordings as strangers make them: with holes, lost poses, missing files and wrong cameras. What is wrong is counted and said.

use std::fmt::Write as _;
use std::process::Command;

use image::{ImageBuffer, Luma, Rgb};
use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use paintcopter::scan::FrameRange;

use crate::scratch::Scratch;

pub(crate) const SIZE: (u32, u32) = (160, 120);
/// Focal length and centre of the pictures.
pub(crate) const CAMERA: [f64; 4] = [130.0, 130.0, 79.5, 59.5];
pub(crate) const FRAMES: usize = 12;

/// Poses on a short arc before a corner of a room.
pub(crate) fn pose(k: usize) -> Isometry3<f64> {
    let t = k as f64 / FRAMES as f64;
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.05 * t, 0.25 * t, 0.02));
    Isometry3::from_parts(Vector3::new(0.2 * t, 0.05 * (4.0 * t).sin(), 0.1 * t * t).into(), turn)
}

/// Depth along the optical axis to three walls and a ball.
fn depth(world_from_camera: &Isometry3<f64>, u: f64, v: f64) -> f64 {
    let [fx, fy, cx, cy] = CAMERA;
    let (o, d) = (
        world_from_camera.translation.vector,
        world_from_camera.rotation * Vector3::new((u - cx) / fx, (v - cy) / fy, 1.0),
    );
    let wall = |n: Vector3<f64>, c: f64| Some((c - n.dot(&o)) / n.dot(&d)).filter(|t| *t > 0.0);
    let walls = [
        wall(Vector3::new(0.3, 0.0, 1.0), 2.0),
        wall(Vector3::new(1.0, 0.1, -0.2), 0.7),
        wall(Vector3::new(0.1, 1.0, 0.0), 0.6),
    ];
    let to = o - Vector3::new(-0.4, 0.0, 1.5);
    let (a, b, c) = (d.norm_squared(), to.dot(&d), to.norm_squared() - 0.09);
    let ball = (b * b >= a * c).then(|| (-b - (b * b - a * c).sqrt()) / a).filter(|t| *t > 0.0);
    walls.into_iter().chain([ball]).flatten().fold(f64::INFINITY, f64::min)
}

/// A recording in the layout of TUM.
pub(crate) fn recording(name: &str) -> Scratch {
    let s = Scratch::new(name);
    for folder in ["depth", "rgb"] {
        std::fs::create_dir_all(s.0.join(folder)).unwrap();
    }
    let [mut depths, mut colours, mut poses] = [(); 3].map(|()| String::new());
    for k in 0..FRAMES {
        let pose = pose(k);
        let image = ImageBuffer::from_fn(SIZE.0, SIZE.1, |u, v| {
            Luma([(1000.0 * depth(&pose, f64::from(u), f64::from(v))).round() as u16])
        });
        image.save(s.0.join(format!("depth/{k}.png"))).unwrap();
        let picture = ImageBuffer::from_fn(SIZE.0, SIZE.1, |u, v| {
            let (u, v) = (f64::from(u), f64::from(v));
            let ray = Point3::new((u - CAMERA[2]) / CAMERA[0], (v - CAMERA[3]) / CAMERA[1], 1.0);
            let p = pose * (ray * depth(&pose, u, v));
            Rgb([(128.0 + 50.0 * (15.0 * p.x + 9.0 * p.z).sin() + 50.0 * (13.0 * p.y).cos()) as u8; 3])
        });
        picture.save(s.0.join(format!("rgb/{k}.png"))).unwrap();
        let stamp = 10.0 + 0.1 * k as f64;
        writeln!(depths, "{stamp} depth/{k}.png").unwrap();
        writeln!(colours, "{stamp} rgb/{k}.png").unwrap();
        let (t, q) = (pose.translation.vector, pose.rotation.coords);
        writeln!(poses, "{stamp} {} {} {} {} {} {} {}", t.x, t.y, t.z, q.x, q.y, q.z, q.w).unwrap();
    }
    s.write("depth.txt", depths);
    s.write("rgb.txt", colours);
    s.write("groundtruth.txt", poses);
    let [fx, fy, cx, cy] = CAMERA;
    s.write("intrinsics.txt", format!("{} {} {fx} {fy} {cx} {cy} 1000\n", SIZE.0, SIZE.1));
    s
}

/// What a run of `scan` said and wrote.
pub(crate) struct Ran {
    pub(crate) ok: bool,
    pub(crate) said: String,
    pub(crate) report: serde_json::Value,
}

impl Ran {
    pub(crate) fn figure(&self, name: &str) -> f64 {
        self.report[name].as_f64().unwrap_or_else(|| panic!("no {name} in {}: {}", self.report, self.said))
    }

    pub(crate) fn says(&self, words: &[&str]) {
        for word in words {
            assert!(self.said.contains(word), "\"{word}\" is missing in: {}", self.said);
        }
    }
}

pub(crate) fn scan(s: &Scratch, options: &[&str]) -> Ran {
    let out = s.path("out");
    let mut command = Command::new(env!("CARGO_BIN_EXE_scan"));
    command.args(["--sequence", s.0.to_str().unwrap(), "--out", &out, "--threads", "1"]);
    if !options.contains(&"--voxel") {
        command.args(["--voxel", "0.02"]);
    }
    let output = command.args(options).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!said.contains("panicked"), "{said}");
    let report = std::fs::read(s.0.join("out/report.json")).ok().and_then(|text| serde_json::from_slice(&text).ok());
    Ran { ok: output.status.success(), said, report: report.unwrap_or_default() }
}

/// Changes the pixels of a depth image.
pub(crate) fn change(s: &Scratch, k: usize, f: impl Fn(u32, u32, u16) -> u16) {
    let path = s.0.join(format!("depth/{k}.png"));
    let mut image = image::open(&path).unwrap().into_luma16();
    image.enumerate_pixels_mut().for_each(|(u, v, pixel)| pixel.0 = [f(u, v, pixel.0[0])]);
    image.save(&path).unwrap();
}

#[test]
fn a_recording_says_which_camera_it_uses() {
    let s = recording("plain");
    let ran = scan(&s, &[]);
    assert!(ran.ok, "{}", ran.said);
    ran.says(&["fx 130", "160 x 120 pixels", "intrinsics.txt", "1000 units per metre"]);
    assert!(ran.figure("fused_share") > 0.99 && ran.figure("depth_agreement_median") > 0.9, "{}", ran.report);
    assert_eq!(ran.report["poses"], "given");
    // Without the file camera and scale are assumed, and said to be; here they are wrong, and that is seen.
    std::fs::remove_file(s.0.join("intrinsics.txt")).unwrap();
    let ran = scan(&s, &["--depth-scale", "1000"]);
    ran.says(&["fx 525", "assumed: there is no intrinsics.txt", "--depth-scale"]);
    assert!(!ran.ok, "{}", ran.said);
    ran.says(&["agrees with the map", "--intrinsics"]);
    // What the command line knows better.
    let ran = scan(&s, &["--depth-scale", "1000", "--intrinsics", "130,130,79.5,59.5"]);
    assert!(ran.ok, "{}", ran.said);
}

#[test]
fn a_wrong_camera_is_seen_by_its_residuals() {
    let s = recording("swapped");
    let ran = scan(&s, &["--intrinsics", "79.5,59.5,130,130"]);
    assert!(!ran.ok, "{}", ran.said);
    ran.says(&["warning", "agrees with the map"]);
    assert!(ran.figure("depth_agreement_median") < 0.6, "{}", ran.report);
}

/// The tracker makes do with a wrong camera: the frames agree with the map that it makes of them.
#[test]
fn a_wrong_camera_is_named_where_poses_are_tracked() {
    let s = recording("tracked");
    let ran = scan(&s, &["--poses", "tracked"]);
    assert!(ran.ok, "{}", ran.said);
    for wrong in ["100,100,79.5,59.5", "130,130,59.5,79.5"] {
        let ran = scan(&s, &["--poses", "tracked", "--intrinsics", wrong]);
        assert!(!ran.ok, "{wrong}: {}", ran.said);
        ran.says(&["do not fit each other", "with --intrinsics "]);
        let focal = ran.report["camera_fits_better_px"][0].as_f64().unwrap();
        assert!((focal / CAMERA[0] - 1.0).abs() < 0.03, "{focal}");
    }
    // A smaller world fits as well, but not the recorded path.
    let ran = scan(&s, &["--poses", "tracked", "--depth-scale", "1500"]);
    assert!(!ran.ok, "{}", ran.said);
    ran.says(&["recorded", "with --depth-scale "]);
}

#[test]
fn a_transposed_camera_matrix_is_refused() {
    let s = Scratch::new("transposed");
    ImageBuffer::from_pixel(8, 8, Luma([1000_u16])).save(s.0.join("frame-000000.depth.png")).unwrap();
    s.write("camera-intrinsics.txt", "130 0 0\n0 130 0\n79.5 59.5 1\n");
    let ran = scan(&s, &[]);
    assert!(!ran.ok, "{}", ran.said);
    ran.says(&["camera-intrinsics.txt", "transposed"]);
}

#[test]
fn holes_in_a_grid_cost_nothing() {
    let s = recording("grid");
    (0..FRAMES).for_each(|k| change(&s, k, |u, v, d| if u % 5 == 0 || v % 5 == 0 { 0 } else { d }));
    let ran = scan(&s, &[]);
    assert!(ran.ok, "{}", ran.said);
    assert!(ran.figure("fused_share") > 0.98 && ran.figure("filled_share") > 0.5, "{}", ran.report);
}

#[test]
fn depth_that_is_no_surface_is_warned_about() {
    let s = recording("noise");
    // Thirteen depths, none often in any window.
    (0..FRAMES).for_each(|k| {
        change(&s, k, |u, v, _| if v < 10 { 1500 } else { (500.0 * 1.2_f64.powi(((u + 5 * v) % 13) as i32)) as u16 });
    });
    let ran = scan(&s, &[]);
    assert!(!ran.ok, "{}", ran.said);
    ran.says(&["warning", "of the valid pixels were fused", "--noise"]);
}

#[test]
fn lost_poses_and_other_sizes_cost_their_frames_only() {
    let s = recording("lost");
    let poses = std::fs::read_to_string(s.0.join("groundtruth.txt")).unwrap();
    let lost = |line: &str, word: &str| {
        let stamp = line.split_whitespace().next().unwrap();
        format!("{stamp}{}", format!(" {word}").repeat(7))
    };
    let rows: Vec<String> = poses
        .lines()
        .enumerate()
        .map(|(k, line)| match k {
            3 => lost(line, "nan"),
            7 => lost(line, "inf"),
            _ => line.to_string(),
        })
        .collect();
    s.write("groundtruth.txt", rows.join("\n"));
    ImageBuffer::from_pixel(80, 60, Luma([1500_u16])).save(s.0.join("depth/5.png")).unwrap();
    let ran = scan(&s, &[]);
    assert!(ran.ok, "{}", ran.said);
    assert_eq!((ran.figure("frames"), ran.figure("frames_skipped")), (FRAMES as f64 - 3.0, 3.0));
    ran.says(&["depth/3.png: its recorded pose is not finite", "depth/7.png: its recorded", "80 x 60 pixels"]);
}

#[test]
fn a_missing_colour_image_costs_the_colour_only() {
    let s = recording("grey");
    std::fs::remove_file(s.0.join("rgb/4.png")).unwrap();
    let ran = scan(&s, &[]);
    assert!(ran.ok, "{}", ran.said);
    assert_eq!((ran.figure("frames"), ran.figure("frames_without_colour")), (FRAMES as f64, 1.0));
    ran.says(&["without colour", "4.png"]);
}

#[test]
fn most_frames_lost_is_no_success() {
    let s = recording("most");
    (0..8).for_each(|k| s.write(&format!("depth/{k}.png"), "no picture"));
    let ran = scan(&s, &[]);
    assert!(!ran.ok, "{}", ran.said);
    ran.says(&["only 4 of 12 frames"]);
    assert_eq!(ran.figure("frames"), 4.0, "the report is written all the same");
}

/// Voxels as large as the room: there is a map, and nothing in it.
#[test]
fn a_map_without_surface_is_no_success() {
    let s = recording("empty");
    let ran = scan(&s, &["--voxel", "5"]);
    assert!(!ran.ok, "{}", ran.said);
    ran.says(&["no surface", "--voxel"]);
}

#[test]
fn without_poses_the_way_out_is_named_and_works() {
    let s = recording("unplaced");
    let ran = scan(&s, &["--poses", "tracked"]);
    assert!(ran.ok, "{}", ran.said);
    assert!(ran.figure("ate_se3_rmse_m") < 5e-3, "{}", ran.report);
    assert_eq!((ran.figure("tracking_losses"), ran.figure("frames")), (0.0, FRAMES as f64));
    std::fs::remove_file(s.0.join("groundtruth.txt")).unwrap();
    let ran = scan(&s, &[]);
    assert!(!ran.ok, "{}", ran.said);
    ran.says(&["--poses tracked"]);
    let ran = scan(&s, &["--poses", "tracked"]);
    assert!(ran.ok && ran.report["ate_se3_rmse_m"].is_null(), "{}", ran.said);
    let rows = std::fs::read_to_string(s.0.join("out/trajectory.tum")).unwrap();
    assert_eq!(rows.lines().count(), FRAMES);
}

#[test]
fn a_run_that_was_cut_off_goes_on_to_the_same_map() {
    let s = recording("resumed");
    let whole = scan(&s, &[]);
    let half = scan(&s, &["--frames", "..6"]);
    assert!(half.ok, "{}", half.said);
    // The map says how far it had come with these frames.
    let map = s.path("half.tsdf");
    std::fs::copy(s.0.join("out/map.tsdf"), &map).unwrap();
    let rest = scan(&s, &["--resume", &map]);
    assert!(rest.ok, "{}", rest.said);
    assert_eq!((rest.figure("frames_resumed"), rest.figure("frames")), (6.0, 6.0));
    assert_eq!(rest.report["map_hash"], whole.report["map_hash"]);
    let rows = std::fs::read_to_string(s.0.join("out/trajectory.tum")).unwrap();
    assert_eq!(rows.lines().count(), FRAMES);
}

#[test]
fn messages_name_options() {
    let s = recording("options");
    for (options, words) in [
        (&["--host-mib", "1", "--active-mib", "0"][..], "--active-mib"),
        (&["--active-mib", "17592186044417"], "--active-mib 17592186044417"),
        (&["--voxel", "0"], "--voxel"),
        (&["--noise", "1,2"], "--noise"),
        (&["--frames", "9..3"], "--frames"),
        (&["--frames", "100.."], "--frames"),
    ] {
        let ran = scan(&s, options);
        assert!(!ran.ok, "{options:?}: {}", ran.said);
        ran.says(&[words]);
        assert!(!ran.said.contains("max_bytes") && !ran.said.contains("voxel_size"), "{}", ran.said);
    }
}

#[test]
fn a_range_of_frames_is_read_as_written() {
    let of = |text: &str| FrameRange::parse(text);
    assert_eq!(of("3..9:2"), of("3..9:2"));
    for wrong in ["", "5", "..:0", "4..4", "a..b", "1..2:x", "-1..3"] {
        assert!(of(wrong).is_err(), "{wrong}");
    }
    let s = recording("range");
    let ran = scan(&s, &["--frames", "2..11:4"]);
    assert_eq!(ran.figure("frames"), 3.0, "frames 2, 6 and 10: {}", ran.said);
}

#[test]
fn a_folder_that_cannot_be_written_is_noticed_first() {
    let s = recording("out");
    s.write("out", "a file where the folder should be");
    let ran = scan(&s, &[]);
    assert!(!ran.ok && !ran.said.contains("fuse"), "{}", ran.said);
    ran.says(&["--out"]);
}

#[test]
fn a_colour_camera_beside_the_depth_camera_is_registered() {
    let s = recording("beside");
    // The colour camera stands where the depth camera does, but its pictures are named as if it were 5 cm aside: colours then shift.
    s.write("extrinsic.txt", "1 0 0 0.05  0 1 0 0  0 0 1 0  0 0 0 1\n");
    let (plain, moved) = (scan(&s, &[]), scan(&s, &["--depth-from-colour", &s.path("extrinsic.txt")]));
    assert!(plain.ok && moved.ok, "{}", moved.said);
    assert_eq!(plain.figure("vertices"), moved.figure("vertices"), "only colours differ");
    assert_ne!(plain.report["map_hash"], moved.report["map_hash"]);
    s.write("extrinsic.txt", "1 0 0\n");
    let ran = scan(&s, &["--depth-from-colour", &s.path("extrinsic.txt")]);
    assert!(!ran.ok);
    ran.says(&["extrinsic.txt", "16 numbers"]);
}
