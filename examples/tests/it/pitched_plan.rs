//! A vehicle that pitches is planned for: undersides that the level one leaves bare.

use std::fmt::Write;
use std::process::Command;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use ptu_kinematics::{KinematicChain, PitchingJoints, PitchingPtu, Ptu, PtuSettings, Range};

use crate::scratch::Scratch;

/// Half of the box's side, metres.
const HALF: f64 = 0.9;
/// How far under a ceiling the level vehicle paints, metres: the arm and what the gun sticks out, while the middle of the rotors, of 0.35 m
/// radius, must stay beside it. The tip rises 0.21 m at most and the spray 0.15 m: less than the rotors and their clearance.
const LEVEL: f64 = 0.65;

/// A box of 1.8 x 1.8 x 0.3 m whose faces are squares of 0.3 m.
fn box_mesh() -> String {
    let (mut points, mut faces) = (Vec::<[i32; 3]>::new(), String::new());
    let mut corner = |p: [i32; 3]| {
        points.iter().position(|q| *q == p).unwrap_or_else(|| {
            points.push(p);
            points.len() - 1
        }) + 1
    };
    let mut side = |from: [i32; 3], u: [i32; 3], v: [i32; 3], counts: [i32; 2]| {
        for (i, j) in (0..counts[0]).flat_map(|i| (0..counts[1]).map(move |j| (i, j))) {
            let at = |i: i32, j: i32| std::array::from_fn(|k| from[k] + i * u[k] + j * v[k]);
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)].map(&mut corner);
            let _ = write!(faces, "f {a} {b} {c}\nf {a} {c} {d}\n");
        }
    };
    side([-3, -3, 0], [0, 1, 0], [1, 0, 0], [6, 6]);
    side([-3, -3, 1], [1, 0, 0], [0, 1, 0], [6, 6]);
    side([-3, -3, 0], [1, 0, 0], [0, 0, 1], [6, 1]);
    side([3, -3, 0], [0, 1, 0], [0, 0, 1], [6, 1]);
    side([3, 3, 0], [-1, 0, 0], [0, 0, 1], [6, 1]);
    side([-3, 3, 0], [0, -1, 0], [0, 0, 1], [6, 1]);
    let points = points.iter().map(|p| {
        let [x, y, z] = p.map(|c| 0.3 * f64::from(c));
        format!("v {x} {y} {z}\n")
    });
    points.collect::<String>() + &faces
}

fn run(s: &Scratch, program: &str, line: &str) -> (Option<i32>, String) {
    let output = Command::new(program).current_dir(&s.0).args(line.split_whitespace()).output().unwrap();
    (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
}

/// Rows of `plan.csv`.
fn rows(s: &Scratch, folder: &str) -> Vec<Vec<f64>> {
    let text = std::fs::read_to_string(s.0.join(folder).join("plan.csv")).unwrap();
    let header = "time_s,layer,x_m,y_m,z_m,heading_rad,vx_m_per_s,vy_m_per_s,vz_m_per_s,pan_rad,tilt_rad,flow_m3_per_s,target_x_m,\
                  target_y_m,target_z_m,pitch_rad";
    assert_eq!(text.lines().next(), Some(header));
    text.lines().skip(1).map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect()).collect()
}

/// How far from the rim each target of the underside lies that paint falls on, metres.
fn depths_below(rows: &[Vec<f64>]) -> Vec<f64> {
    let extent = |k: usize| rows.iter().fold((f64::MAX, f64::MIN), |(a, b), row| (a.min(row[k]), b.max(row[k])));
    let (x, y, bottom) = (extent(12), extent(13), extent(14).0);
    let below = rows.iter().filter(|row| row[11] > 0.0 && row[14] < bottom + 0.01);
    below.map(|row| HALF - (row[12] - 0.5 * (x.0 + x.1)).abs().max((row[13] - 0.5 * (y.0 + y.1)).abs())).collect()
}

#[test]
fn the_middle_of_an_underside_is_planned_for_a_vehicle_that_pitches_alone() {
    let s = Scratch::new("pitched");
    s.write("box.obj", box_mesh());
    let line = "--mesh box.obj --scale 1 --up z --design gradient --texel 0.025 --spot 0.05";
    for (more, out) in [("--tilt 80", "level"), ("--pitch 45", "pitched"), ("--tilt 80 --pitch 45", "both")] {
        let (code, text) = run(&s, env!("CARGO_BIN_EXE_plan"), &format!("{line} {more} --out {out}"));
        assert_eq!(code, Some(0), "{text}");
        assert_eq!(text.contains("not rehearsed in wind"), out != "level", "{text}");
    }
    let level = rows(&s, "level");
    assert!(level.iter().all(|row| row[15] == 0.0));
    let deepest = depths_below(&level).into_iter().fold(0.0, f64::max);
    assert!(deepest > 0.0 && deepest < LEVEL, "{deepest} m");

    let tilt = 45_f64.to_radians();
    let ptu = Ptu::new(PtuSettings { tilt_limits: Range::symmetric(80_f64.to_radians()), ..PtuSettings::default() });
    let chain = PitchingPtu::new(ptu.unwrap(), Range::symmetric(tilt)).unwrap();
    for out in ["pitched", "both"] {
        let rows = rows(&s, out);
        // Sprays lie 7.5 cm apart: some as near to the middle as that.
        let deepest = depths_below(&rows).into_iter().fold(0.0, f64::max);
        assert!(deepest > HALF - 0.075, "{deepest} m");
        let bottom = rows.iter().map(|row| row[14]).fold(f64::MAX, f64::min);
        for row in &rows {
            let joints = PitchingJoints { pitch: row[15], pan: row[9], tilt: row[10] };
            assert!(joints.pitch.abs() <= tilt + 1e-9 && joints.tilt.abs() <= tilt + 1e-9, "{joints:?}");
            let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), row[5]);
            let nozzle =
                chain.forward(&Isometry3::from_parts(Translation3::new(row[2], row[3], row[4]), turn), &joints);
            // What the table says hits what the table says.
            let to_target = Vector3::new(row[12], row[13], row[14]) - nozzle.tip.coords;
            let miss = to_target.cross(&nozzle.direction).norm();
            assert!(row[11] == 0.0 || (miss < 0.025 && to_target.dot(&nozzle.direction) > 0.0), "{miss} m: {row:?}");
            // The rotors stay below the box where they are under its middle.
            let under_middle = row[14] < bottom + 0.01 && row[11] > 0.0 && joints.pitch > 0.3;
            assert!(!under_middle || row[4] < bottom - 0.35, "{row:?}");
        }
    }
    let file: serde_json::Value =
        serde_json::from_slice(&std::fs::read(s.0.join("pitched/report.json")).unwrap()).unwrap();
    let pitch = file["max_pitch_rad"].as_f64().unwrap();
    assert!(pitch > 0.5 && pitch <= tilt + 1e-9, "{pitch}");
}

#[test]
fn a_vehicle_that_pitches_is_previewed_and_not_flown() {
    let s = Scratch::new("pitched_preview");
    s.write("box.obj", box_mesh());
    let line = "--mesh box.obj --scale 1 --up z --design gradient --texel 0.05 --spot 0.1 --pitch 45";
    for (program, more) in [(env!("CARGO_BIN_EXE_paintcopter"), ""), (env!("CARGO_BIN_EXE_robot"), "--autopilot px4:.")]
    {
        let (code, text) = run(&s, program, &format!("{line} {more} --out flown"));
        assert!(code == Some(1) && text.contains("--pitch") && text.lines().count() == 1, "{text}");
    }
    assert!(!s.0.join("flown").exists());
    for (more, out) in [("", "pitched"), ("--pitch 0", "level")] {
        let line = if more.is_empty() { line.to_owned() } else { line.replace("--pitch 45", more) };
        let (code, text) = run(&s, env!("CARGO_BIN_EXE_paintcopter"), &format!("{line} --preview --out {out}"));
        assert_eq!(code, Some(0), "{text}");
        // Top and underside are three quarters of the box.
        assert_eq!(text.contains("undersides"), out == "level", "{text}");
    }
}
