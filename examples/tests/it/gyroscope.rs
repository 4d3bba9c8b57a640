//! `scan --imu`: the camera is led through frames that are missing.

use std::fmt::Write as _;

use nalgebra::Vector3;

use crate::scratch::Scratch;
use crate::strange_recordings::{FRAMES, pose, recording, scan};

/// Of twelve frames the first four and the last: the camera has turned by 10 degrees in between.
fn with_a_gap(name: &str) -> Scratch {
    let s = recording(name);
    for list in ["depth", "rgb"] {
        let path = format!("{list}.txt");
        let text = std::fs::read_to_string(s.0.join(&path)).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        s.write(&path, [lines[0], lines[1], lines[2], lines[3], lines[FRAMES - 1]].join("\n"));
    }
    s
}

/// What a gyroscope on the camera reads between the poses, with a sign and with stamps that are so much later.
fn gyroscope(s: &Scratch, sign: f64, later: f64) -> String {
    let mut text = String::new();
    for k in 0..FRAMES - 1 {
        let turn = (pose(k).rotation.inverse() * pose(k + 1).rotation).scaled_axis();
        let rate: Vector3<f64> = sign * turn / 0.1;
        for part in 0..10 {
            let seconds = 10.0 + later + 0.1 * k as f64 + 0.01 * f64::from(part);
            let stamp = (1e9 * seconds).round() as u64;
            writeln!(text, "{stamp},{},{},{},0,0,9.81", rate.x, rate.y, rate.z).unwrap();
        }
    }
    let end = (1e9 * (10.0 + later + 0.1 * (FRAMES - 1) as f64)) as u64 + 1_000_000;
    writeln!(text, "{end},0,0,0,0,0,9.81").unwrap();
    s.write("imu.csv", text);
    s.path("imu.csv")
}

/// Metres between the last pose that was written and the true one; `None` if the last frame was lost.
fn last_error(s: &Scratch) -> Option<f64> {
    let text = std::fs::read_to_string(s.0.join("out/trajectory.tum")).unwrap();
    let last: Vec<f64> = text.lines().last()?.split_whitespace().map(|word| word.parse().unwrap()).collect();
    let frame = ((last[0] - 10.0) / 0.1).round() as usize;
    (frame == FRAMES - 1).then(|| (Vector3::new(last[1], last[2], last[3]) - pose(frame).translation.vector).norm())
}

/// Right, or lost and said to be: it must not be placed half a metre off.
fn is_honest(s: &Scratch, said: &str) -> bool {
    last_error(s).map_or(said.contains("the camera is lost"), |off| off < 8e-3)
}

#[test]
fn a_camera_is_found_after_frames_that_are_missing() {
    let s = with_a_gap("gyroscope");
    // By the features of keyframes.
    let alone = scan(&s, &["--poses", "tracked"]);
    assert!(alone.ok && last_error(&s).unwrap() < 8e-3, "{:?} {}", last_error(&s), alone.said);
    // In the dark by how keyframes look, or not at all; with a gyroscope in any case, and one on the wrong axes leads nowhere.
    std::fs::remove_file(s.0.join("rgb.txt")).unwrap();
    let dark = scan(&s, &["--poses", "tracked"]);
    assert!(is_honest(&s, &dark.said), "{:?} {}", last_error(&s), dark.said);
    let led = scan(&s, &["--poses", "tracked", "--imu", &gyroscope(&s, 1.0, 0.0)]);
    assert!(led.ok && last_error(&s).unwrap() < 8e-3, "{:?} {}", last_error(&s), led.said);
    let misled = scan(&s, &["--poses", "tracked", "--imu", &gyroscope(&s, -1.0, 0.0)]);
    assert!(is_honest(&s, &misled.said), "{:?} {}", last_error(&s), misled.said);
}

#[test]
fn what_is_no_gyroscope_of_this_recording_is_refused() {
    let s = with_a_gap("gyroscope-refused");
    let path = gyroscope(&s, 1.0, 100.0);
    let late = scan(&s, &["--poses", "tracked", "--imu", &path]);
    assert!(!late.ok && late.said.contains("are not those of the images"), "{}", late.said);
    let given = scan(&s, &["--imu", &path]);
    assert!(!given.ok && given.said.contains("--imu: goes with --poses tracked"), "{}", given.said);
    s.write("imu.csv", "1,2,3\n");
    let broken = scan(&s, &["--poses", "tracked", "--imu", &path]);
    assert!(!broken.ok && broken.said.contains("imu.csv") && broken.said.contains("expected 7"), "{}", broken.said);
}
