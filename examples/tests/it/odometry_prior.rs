//! Recorded poses as an odometry: wrong by centimetres and degrees from frame to frame, and the tracker puts them right.

use std::fmt::Write as _;

use image::{ImageBuffer, Luma};
use nalgebra::{Isometry3, Vector3};
use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng, SeedableRng};

use crate::scratch::Scratch;
use crate::strange_recordings::{FRAMES, SIZE, pose, recording, scan};

/// Standard deviations of the motion from frame to frame, degrees and metres.
const ERROR: [f64; 2] = [2.0, 0.03];

/// Motions with errors, put together: the odometry of the recording.
fn corrupt(s: &Scratch) -> f64 {
    let mut random = SplitMix64::seed_from_u64(5);
    let mut normal = || (0..12).map(|_| random.next_u64() as f64 / u64::MAX as f64).sum::<f64>() - 6.0;
    let mut drifted = pose(0);
    let mut text = String::new();
    for k in 0..FRAMES {
        if k > 0 {
            let shift = Vector3::from_fn(|_, _| ERROR[1] * normal());
            let turn = Vector3::from_fn(|_, _| ERROR[0].to_radians() * normal());
            drifted = drifted * (pose(k - 1).inverse() * pose(k)) * Isometry3::new(shift, turn);
        }
        let (t, q) = (drifted.translation.vector, drifted.rotation.coords);
        let stamp = 10.0 + 0.1 * k as f64;
        writeln!(text, "{stamp} {} {} {} {} {} {} {}", t.x, t.y, t.z, q.x, q.y, q.z, q.w).unwrap();
    }
    s.write("groundtruth.txt", text);
    (drifted.translation.vector - pose(FRAMES - 1).translation.vector).norm()
}

/// Of the trajectory that was written: frames, largest error of a position in metres.
fn trajectory(s: &Scratch) -> (usize, f64) {
    let text = std::fs::read_to_string(s.0.join("out/trajectory.tum")).unwrap();
    let lines: Vec<Vec<f64>> =
        text.lines().map(|line| line.split_whitespace().map(|word| word.parse().unwrap()).collect()).collect();
    let errors = lines.iter().map(|line| {
        let k = ((line[0] - 10.0) / 0.1).round() as usize;
        (Vector3::new(line[1], line[2], line[3]) - pose(k).translation.vector).norm()
    });
    (lines.len(), errors.fold(0.0, f64::max))
}

const OPTIONS: [&str; 4] = ["--poses", "odometry", "--odometry-error", "2,0.03"];

#[test]
fn odometry_that_drifts_is_put_right_frame_by_frame() {
    let s = recording("odometry");
    let drift = corrupt(&s);
    assert!(drift > 0.06, "the drift is worth correcting: {drift} m");
    let ran = scan(&s, &OPTIONS);
    assert!(ran.ok, "{}", ran.said);
    let (frames, worst) = trajectory(&s);
    assert!(frames + 1 >= FRAMES && worst < 8e-3, "{frames} frames, {worst} m: {}", ran.said);
    // A claim of no error makes every correction implausible, which is said.
    let sure = scan(&s, &["--poses", "odometry", "--odometry-error", "0.01,0.0001"]);
    sure.says(&["the motion is not plausible"]);
}

/// The camera sees nothing for a while: odometry leads on, and what comes after is found there.
#[test]
fn odometry_carries_over_a_gap() {
    let s = recording("gap");
    corrupt(&s);
    for k in 5..8 {
        ImageBuffer::from_pixel(SIZE.0, SIZE.1, Luma([0_u16])).save(s.0.join(format!("depth/{k}.png"))).unwrap();
    }
    let ran = scan(&s, &OPTIONS);
    assert!(ran.ok, "{}", ran.said);
    ran.says(&["depth/5.png: nothing to fuse", "depth/7.png: nothing to fuse"]);
    let (frames, worst) = trajectory(&s);
    assert!(frames >= FRAMES - 4 && worst < 8e-3, "{frames} frames, {worst} m: {}", ran.said);
}

#[test]
fn an_error_of_nothing_is_refused() {
    let s = recording("no-error");
    for wrong in ["0,0.01", "1", "1,x", "-1,0.1"] {
        let ran = scan(&s, &["--poses", "odometry", &format!("--odometry-error={wrong}")]);
        assert!(!ran.ok, "{wrong}");
        ran.says(&["--odometry-error"]);
    }
    let ran = scan(&s, &["--poses", "tracked", "--odometry-error", "1,0.01"]);
    assert!(!ran.ok);
    ran.says(&["--odometry-error: goes with --poses odometry"]);
}

/// A file beside the recording, of a body that the camera sits on, at other stamps than the images'.
#[test]
fn poses_of_a_file_are_taken() {
    let s = recording("pose-file");
    let body_from_camera = Isometry3::new(Vector3::new(0.1, -0.05, 0.2), Vector3::new(0.3, -1.2, 0.4));
    let mut text = String::new();
    for k in 0..FRAMES {
        let body = pose(k) * body_from_camera.inverse();
        let (t, q) = (body.translation.vector, body.rotation.coords);
        // The last frame is left out.
        if k + 1 < FRAMES {
            writeln!(text, "{} {} {} {} {} {} {} {}", 10.0 + 0.1 * k as f64, t.x, t.y, t.z, q.x, q.y, q.z, q.w)
                .unwrap();
        }
    }
    s.write("body.tum", text);
    let matrix: Vec<String> = body_from_camera.to_homogeneous().transpose().iter().map(f64::to_string).collect();
    s.write("camera.txt", matrix.join(" "));
    s.write("groundtruth.txt", "10.0 1 2 3 0 0 0 1\n");
    let (file, camera) = (s.path("body.tum"), s.path("camera.txt"));
    let ran = scan(&s, &["--pose-file", &file, "--body-from-camera", &camera]);
    assert!(ran.ok, "{}", ran.said);
    ran.says(&["poses of 11 of 12 frames", "depth/11.png: no pose was recorded for it"]);
    let (frames, worst) = trajectory(&s);
    assert!(frames == FRAMES - 1 && worst < 1e-9, "{frames} frames, {worst} m");
    s.write("later.tum", "99.0 1 2 3 0 0 0 1\n99.1 1 2 3 0 0 0 1\n");
    let ran = scan(&s, &["--pose-file", &s.path("later.tum")]);
    assert!(!ran.ok);
    ran.says(&["later.tum", "99.000 to 99.100 s", "10.000 to 11.100 s"]);
    s.write("short.txt", "1 0 0 0");
    let ran = scan(&s, &["--pose-file", &file, "--body-from-camera", &s.path("short.txt")]);
    assert!(!ran.ok);
    ran.says(&["short.txt", "the 16 numbers of body_from_camera, found 4"]);
}
