//! Missions that keep out of volumes and keep their hose behind them, and a vehicle that pitches under an overhang.

use std::process::Command;

use nalgebra::{Point3, UnitVector3, Vector3};
use paint_planner::mission::reachable_targets;
use paint_planner::{Settings, Target, Tool, VehicleState, plan};
use paint_sim::TriangleSurface;
use paintcopter::adapters::{MeshSurface, Robot};
use paintcopter::mission_file::MissionFile;
use ptu_kinematics::{KinematicChain, PitchingPtu, Ptu, PtuSettings, Range};

use crate::scratch::Scratch;

/// A wall of 1.6 x 0.8 m that faces -x, on the ground.
const WALL: &str = "v 0 0.8 0\nv 0 -0.8 0\nv 0 -0.8 0.8\nv 0 0.8 0.8\nf 1 2 3\nf 1 3 4\n";

const MISSION: &str = r#"
mesh = "wall.obj"
scale = 1.0
up = "z"
design = "gradient"
[settings.constraints]
keep_out = [{ sphere = { centre = [-0.5, 0.5, 2.0], radius = 0.2 } }]
tether = { anchor = [-3.0, -1.0, 0.0], half_angle = 0.9 }
"#;

fn run(s: &Scratch, program: &str, arguments: &[&str]) -> (Option<i32>, String) {
    let output = Command::new(program).current_dir(&s.0).args(arguments).output().unwrap();
    (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
}

fn figure(s: &Scratch, name: &str, key: &str) -> Option<f64> {
    serde_json::from_slice::<serde_json::Value>(&std::fs::read(s.0.join(name)).unwrap()).unwrap()[key].as_f64()
}

/// Rows of `plan.csv` as vehicle states.
fn states(s: &Scratch, name: &str) -> Vec<VehicleState> {
    let text = std::fs::read_to_string(s.0.join(name)).unwrap();
    let row = |line: &str| {
        let v: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
        VehicleState { position: Point3::new(v[2], v[3], v[4]), heading: v[5], pan: v[9], tilt: v[10] }
    };
    text.lines().skip(1).map(row).collect()
}

#[test]
fn a_mission_keeps_out_of_volumes_and_its_hose_behind_it() {
    let s = Scratch::new("constraints");
    s.write("wall.obj", WALL);
    s.write("mission.toml", MISSION);
    s.write("free.toml", MISSION.split("[settings.constraints]").next().unwrap());
    let constraints = MissionFile::read(&s.0.join("mission.toml")).unwrap().settings.constraints;
    let tether = constraints.tether.unwrap();
    let robot = Robot::new(Ptu::new(PtuSettings::default()).unwrap());
    // Least distance to the volume, and greatest angle of the hose off the back, over a planned flight.
    let flight = |states: &[VehicleState]| {
        let (mut spheres, mut gap, mut angle) = (Vec::new(), f64::INFINITY, 0.0_f64);
        for state in states {
            spheres.clear();
            robot.spheres(state, &mut spheres);
            let distances = spheres.iter().map(|(centre, radius)| constraints.keep_out[0].distance(centre) - radius);
            gap = distances.fold(gap, f64::min);
            angle = angle.max(tether.angle(state).abs());
        }
        (gap, angle)
    };
    for (mission, out) in [("free.toml", "free"), ("mission.toml", "kept")] {
        let (code, text) = run(&s, env!("CARGO_BIN_EXE_plan"), &["--mission", mission, "--out", out]);
        assert_eq!(code, Some(0), "{text}");
        assert_eq!(text.contains("lost to keep-out volumes and tether"), out == "kept", "{text}");
    }
    let (free, kept) = (flight(&states(&s, "free/plan.csv")), flight(&states(&s, "kept/plan.csv")));
    assert!(free.0 < 0.0, "the volume is not in the way: {free:?}");
    assert!(kept.0 > 0.0 && kept.1 < tether.half_angle + 0.01, "{kept:?}");
    let lost = figure(&s, "kept/report.json", "lost_to_constraints_share").unwrap();
    assert!(lost > 0.02 && lost < 0.5, "{lost}");
    assert_eq!(figure(&s, "free/report.json", "lost_to_constraints_share"), None);
    // The file that a run leaves holds what it was told.
    assert_eq!(MissionFile::read(&s.0.join("kept/mission.toml")).unwrap().settings.constraints, constraints);
    for (mission, out) in [("free.toml", "a"), ("mission.toml", "b")] {
        let preview = ["--mission", mission, "--preview", "--out", out];
        assert_eq!(run(&s, env!("CARGO_BIN_EXE_paintcopter"), &preview).0, Some(0));
    }
    let read = |name: &str| std::fs::read(s.0.join(name)).unwrap();
    assert!(read("a/preview.png") != read("b/preview.png"));
    // What leaves nothing, and what is no volume, is said.
    let refused = |constraints: &str, expected: &str| {
        s.write(
            "bad.toml",
            format!("{}\n[settings.constraints]\n{constraints}\n", MISSION.split("[settings").next().unwrap()),
        );
        let (code, text) = run(&s, env!("CARGO_BIN_EXE_plan"), &["--mission", "bad.toml", "--out", "bad"]);
        assert!(code == Some(1) && text.contains(expected), "{text}");
    };
    refused(
        "keep_out = [{ half_space = { point = [0.0, 0.0, 0.0], normal = [1.0, 0.0, 0.0] } }]",
        "settings.constraints",
    );
    refused("keep_out = [{ sphere = { centre = [0.0, 0.0, 0.0], radius = -1.0 } }]", "keep_out.sphere");
    refused("keep_out = [{ ball = { centre = [0.0, 0.0, 0.0], radius = 1.0 } }]", "ball");
    refused("tether = { anchor = [0.0, 0.0, 0.0], half_angle = 9.0 }", "tether.half_angle");
}

/// A roof over the ground, two metres wide, that rises towards -x: its underside leans 20 degrees from the horizontal.
fn overhang() -> TriangleSurface {
    let (sin, cos) = 20_f64.to_radians().sin_cos();
    let corner = |s: f64, y: f64| [-s * cos, y, 3.0 + s * sin].map(|c| c as f32);
    let corners = [corner(0.0, -1.0), corner(0.0, 1.0), corner(2.0, 1.0), corner(2.0, -1.0)];
    TriangleSurface::new(&corners, &[[0, 2, 1], [0, 3, 2]]).unwrap()
}

/// Targets along the underside, 2.5 cm apart.
fn underside() -> Vec<Target> {
    let (sin, cos) = 20_f64.to_radians().sin_cos();
    let normal = UnitVector3::new_normalize(Vector3::new(-sin, 0.0, -cos));
    let target = |k: i32| {
        let point = Point3::new(-cos, -0.5 + 0.025 * f64::from(k), 3.0 + sin);
        Target { point, normal, dose: 1e-6, time: None, stand_off: None }
    };
    (0..40).map(target).collect()
}

#[test]
fn a_vehicle_that_pitches_paints_an_underside_that_the_level_one_names_as_out_of_reach() {
    let (roof, targets) = (overhang(), underside());
    let surface = MeshSurface(&roof);
    let level = Robot::new(Ptu::new(PtuSettings::default()).unwrap());
    let pitching = Robot::new(
        PitchingPtu::new(Ptu::new(PtuSettings::default()).unwrap(), Range::symmetric(45_f64.to_radians())).unwrap(),
    );
    let mut settings = Settings::default();
    // The level vehicle with its own reach, and asked for elevations that its joint does not have.
    let reached = |robot: &dyn Tool, settings: &Settings| {
        reachable_targets(&targets, &surface, robot, settings).unwrap().iter().filter(|reached| **reached).count()
    };
    assert_eq!(reached(&level, &settings), 0);
    assert!(plan(&targets, &surface, &level, &settings).is_err());
    settings.nozzle.max_elevation = 80_f64.to_radians();
    assert_eq!(reached(&level, &settings), 0);
    assert_eq!(reached(&pitching, &settings), targets.len());
    let plan = plan(&targets, &surface, &pitching, &settings).unwrap();
    assert_eq!(plan.report.served, targets.len());
    assert!(plan.report.clearance > 0.0 && plan.report.normal_deviation_max < 0.02, "{:?}", plan.report);
    for (state, nozzle) in plan.vehicle.iter().zip(&plan.nozzle) {
        let joints = pitching.chain.point(state.pan, state.tilt);
        assert!(joints.pitch > 0.3, "{joints:?}");
        let limits = pitching.chain.limits();
        let all = [joints.pitch, joints.pan, joints.tilt];
        assert!(all.iter().zip(&limits).all(|(joint, limits)| limits.contains(*joint)), "{joints:?}");
        let hover = ptu_kinematics::Hover { position: state.position, heading: state.heading, joints };
        let held = pitching.chain.forward(&hover.world_from_body(), &hover.joints);
        assert!((held.tip - nozzle.position).norm() < 1e-9 && held.direction.angle(&nozzle.direction) < 1e-7);
        // It is below the roof.
        assert!(state.position.z < nozzle.position.z);
    }
}
