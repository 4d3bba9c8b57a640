//! Missions as files: written by every run, flown again from anywhere.

use std::process::Command;

use paint_net::painters::LayerPlanning;
use paint_planner::timing::TimingPolicy;
use paint_sim::paint::PaintName;
use paintcopter::mesh_frame::MeshScale;
use paintcopter::mesh_placement::UpAxis;
use paintcopter::mission::{MissionSettings, PainterChoice};
use paintcopter::mission_file::MissionFile;
use paintcopter::mission_paint::MissionPaint;
use paintcopter::palette_choice::PaletteChoice;
use paintcopter::picture_placement::{PicturePlacement, PlacementMode};
use paintcopter::projection::Viewpoint;
use paintcopter::region::Region;
use paintcopter::wall::Wall;

use crate::scratch::Scratch;

#[test]
fn a_mission_keeps_all_that_it_was_told() {
    let s = Scratch::new("kept");
    let mut settings = MissionSettings {
        seed: 7,
        texel: 0.02,
        painter: PainterChoice::Pursuit,
        layered: Some(LayerPlanning::Joint),
        viewpoint: Some(Viewpoint::Point([-1.0, 0.25, 2.0].into())),
        placement: PicturePlacement { mode: PlacementMode::Tile, rotate: 0.1, offset: [0.2, -0.3], size: Some(0.4) },
        ..MissionSettings::default()
    };
    settings.limits.max_sprays = Some(400);
    settings.planner.timing.policy = TimingPolicy::GradientPreserving;
    settings.ptu.pan_limits.max = 1.25;
    settings.servo.dead_time = 0.07;
    settings.ground.sorptivity = 1e-5;
    let told = MissionFile {
        mesh: Some(s.0.join("a.obj")),
        scale: Some(MeshScale::Factor(2.5)),
        up: Some(UpAxis::X),
        design: Some(s.path("b.png")),
        fill: Some(2e-5),
        texture: Some(s.0.join("c.png")),
        scan: true,
        region: Some(Region::Mask(s.0.join("d.png"))),
        keep_clean: vec![Region::Mask(s.0.join("h.png")), Region::Box([0.0, 0.0, 1.0, 1.0, 2.0, 3.0])],
        palette: Some(PaletteChoice::File(s.0.join("f.toml"))),
        available: Some(s.0.join("g.toml")),
        wall: Some(Wall::Colour([1, 2, 255])),
        settings,
        paints: vec![MissionPaint {
            name: PaintName::Green,
            design: None,
            texture: Some(s.0.join("e.png")),
            fill: None,
        }],
    };
    let path = s.0.join("mission.toml");
    told.write(&path).unwrap();
    assert_eq!(MissionFile::read(&path).unwrap(), told);
    MissionFile::default().write(&path).unwrap();
    assert_eq!(MissionFile::read(&path).unwrap(), MissionFile::default());
}

#[test]
fn paths_begin_at_the_folder_of_the_file_and_mistakes_are_named() {
    let s = Scratch::new("paths");
    s.write("mission.toml", "mesh = \"part/wall.obj\"\ndesign = \"part/picture.png\"\n[settings]\nseed = 3\n");
    let mission = MissionFile::read(&s.0.join("mission.toml")).unwrap();
    assert_eq!(mission.mesh, Some(s.0.join("part/wall.obj")));
    assert_eq!(mission.design, Some(s.path("part/picture.png")));
    let expected = MissionSettings { seed: 3, ..MissionSettings::default() };
    assert_eq!(mission.settings, expected);
    s.write("mission.toml", "design = \"stripes\"\n[settings.planner]\nclearence = 0.1\n");
    let error = MissionFile::read(&s.0.join("mission.toml")).unwrap_err().to_string();
    assert!(error.contains("mission.toml") && error.contains("line 3") && error.contains("clearence"), "{error}");
}

#[test]
fn a_run_can_be_repeated_from_the_file_that_it_leaves() {
    let s = Scratch::new("again");
    s.write("wall.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\n");
    let run = |arguments: &[&str], out: &str| {
        let output = Command::new(env!("CARGO_BIN_EXE_paintcopter"))
            .current_dir(&s.0)
            .args(arguments)
            .args(["--preview", "--out", out])
            .output()
            .unwrap();
        (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let first = ["--mesh", "wall.obj", "--scale", "1.5", "--design", "gradient", "--seed", "5", "--speed", "0.3"];
    assert_eq!(run(&first, "one").0, Some(0));
    std::fs::create_dir(s.0.join("elsewhere")).unwrap();
    std::fs::rename(s.0.join("one/mission.toml"), s.0.join("elsewhere/mission.toml")).unwrap();
    let (code, text) = run(&["--mission", "elsewhere/mission.toml"], "two");
    assert_eq!(code, Some(0), "{text}");
    let read = |name: &str| std::fs::read(s.0.join(name)).unwrap();
    assert!(read("one/preview.png") == read("two/preview.png"));
    assert_eq!(read("elsewhere/mission.toml"), read("two/mission.toml"));
    let figures = |name: &str| {
        let mut json: serde_json::Value = serde_json::from_slice(&read(name)).unwrap();
        json.as_object_mut().unwrap().remove("wall_s");
        json
    };
    let one = figures("one/report.json");
    assert_eq!(one, figures("two/report.json"));
    // A wall of 2.25 m² that faces the robot, in rows 3.75 cm apart; its bright rim stays bare.
    assert!((one["surface_area_m2"].as_f64().unwrap() - 2.25).abs() < 0.01);
    assert!(
        one["reach_share"].as_f64().unwrap() > 0.95
            && one["flight_time_s"].as_f64().unwrap() > 0.9 * 2.25 / 0.0375 / 0.3
    );
    // What the line says comes before what the file says, and the file before the defaults.
    let (code, text) = run(&["--mission", "elsewhere/mission.toml", "--seed", "4"], "three");
    let third = MissionFile::read(&s.0.join("three/mission.toml")).unwrap();
    assert_eq!((code, third.settings.seed, third.scale), (Some(0), 4, Some(MeshScale::Factor(1.5))), "{text}");
    // The folder can be moved with what it names.
    std::fs::create_dir(s.0.join("moved")).unwrap();
    for name in ["wall.obj", "two"] {
        std::fs::rename(s.0.join(name), s.0.join("moved").join(name)).unwrap();
    }
    let (code, text) = run(&["--mission", "moved/two/mission.toml"], "four");
    assert_eq!(code, Some(0), "{text}");
}

#[test]
fn several_paints_are_read_checked_and_written() {
    let s = Scratch::new("paints");
    let read = |text: &str| {
        s.write("mission.toml", text);
        MissionFile::read(&s.0.join("mission.toml"))
    };
    let paints = "[[paints]]\nname = \"red\"\ndesign = \"part/red.png\"\n[[paints]]\nname = \"white\"\nfill = 2e-5\n";
    let mission = read(paints).unwrap();
    assert_eq!(mission.paints.len(), 2);
    assert_eq!(mission.paints[0].design.as_deref(), s.0.join("part/red.png").to_str());
    mission.write(&s.0.join("again.toml")).unwrap();
    assert_eq!(MissionFile::read(&s.0.join("again.toml")).unwrap(), mission);

    let refused = |text: String| read(&text).unwrap().decide_coats(&s.0).map(|_| ()).unwrap_err().to_string();
    assert!(refused(format!("design = \"stripes\"\n{paints}")).contains("leave out"));
    assert!(refused("[[paints]]\nname = \"green\"\n".into()).contains("green: give a design"));
    assert!(refused(paints.into()).contains("red.png"), "a picture that is not there is named");
    let error = read(&paints.replace("white", "mauve")).unwrap_err().to_string();
    assert!(error.contains("mauve") && error.contains("charcoal"), "{error}");
}

/// Rows of a table by name of the column.
fn columns(text: &str, names: &[&str]) -> Vec<Vec<f64>> {
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    let places: Vec<usize> = names.iter().map(|name| header.iter().position(|h| h == name).unwrap()).collect();
    let row = |line: &str| {
        let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
        places.iter().map(|&k| cells[k]).collect()
    };
    lines.map(row).collect()
}

#[test]
fn what_plan_exports_is_what_is_flown() {
    let s = Scratch::new("plan");
    s.write("wall.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\n");
    let run = |program: &str, arguments: &[&str], out: &str| {
        let output = Command::new(program).current_dir(&s.0).args(arguments).args(["--out", out]).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    };
    let wall = ["--mesh", "wall.obj", "--scale", "0.6", "--design", "gradient", "--seed", "5"];
    run(env!("CARGO_BIN_EXE_plan"), &wall, "planned");
    run(env!("CARGO_BIN_EXE_paintcopter"), &["--mission", "planned/mission.toml"], "flown");
    let read = |name: &str| String::from_utf8(std::fs::read(s.0.join(name)).unwrap()).unwrap();
    let names = ["time_s", "x_m", "y_m", "z_m", "heading_rad", "pan_rad", "tilt_rad", "flow_m3_per_s", "target_y_m"];
    let (planned, flown) = (columns(&read("planned/plan.csv"), &names), columns(&read("flown/trajectory.csv"), &names));
    assert!(planned.len() > 100 && flown.len().abs_diff(planned.len()) <= 1, "{} {}", planned.len(), flown.len());
    for (p, f) in planned.iter().zip(&flown) {
        // Steps of the simulation are sums of 1 ms: where the valve opens, a row may lie on either side.
        let same = p.iter().zip(f).filter(|(p, f)| (**p - **f).abs() < 1e-6).count();
        assert!(same >= names.len() - 1, "planned {p:?}, flown {f:?}");
    }
    let [planned, flown] = ["planned/report.json", "flown/report.json"]
        .map(|name| serde_json::from_str::<serde_json::Value>(&read(name)).unwrap());
    for key in ["flight_time_s", "path_length_m", "valve_open_share", "strokes", "normal_deviation_max_m"] {
        assert_eq!(planned[key], flown[key], "{key}");
    }
    for file in ["path.png", "plan.mcap"] {
        assert!(std::fs::metadata(s.0.join("planned").join(file)).unwrap().len() > 1000, "{file}");
    }
}
