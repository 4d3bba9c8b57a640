//! Recorded motions of a nozzle become paint.

use std::path::PathBuf;

use clap::Parser as _;
use paintcopter::mission::{Coats, save};
use paintcopter::mission_file::MissionFile;
use paintcopter::spray::{Arguments, SprayError, run};
use serde_json::Value;

use crate::scratch::Scratch;

/// Litres a minute as m³/s.
const FLOW: f64 = 0.06 * 1e-3 / 60.0;
const HEAD: &str = "time_s,nozzle_x_m,nozzle_y_m,nozzle_z_m,axis_x,axis_y,axis_z,nozzle_flow_m3_per_s\n";

/// A wall of 1.2 m by 0.8 m in the plane y = 0 that faces -y.
fn wall(scratch: &Scratch) -> String {
    scratch.write("wall.obj", "v 0 0 0\nv 1.2 0 0\nv 1.2 0 0.8\nv 0 0 0.8\nf 1 2 3\nf 1 3 4\n");
    scratch.path("wall.obj")
}

/// A straight pass at 0.2 m/s, 10 cm before the middle of the wall, spraying all the way; `change` may spoil a line.
fn pass(change: &dyn Fn(usize, [f64; 8]) -> Option<[f64; 8]>) -> String {
    let line = |k: usize| {
        let time = 0.1 * k as f64;
        let row = change(k, [time, 0.2 + 0.2 * time, -0.1, 0.4, 0.0, 1.0, 0.0, FLOW])?;
        Some(row.map(|v| format!("{v:?}")).join(",") + "\n")
    };
    HEAD.to_owned() + &(0..=40).filter_map(line).collect::<String>()
}

fn sprayed(s: &Scratch, nozzle: &str, more: &[&str]) -> Result<Value, SprayError> {
    let out = s.path("out");
    let line = ["spray", "--scale", "1", "--nozzle", nozzle, "--threads", "2", "--out", &out];
    run(&Arguments::try_parse_from(line.iter().chain(more)).unwrap())?;
    Ok(serde_json::from_slice(&std::fs::read(s.0.join("out/report.json")).unwrap()).unwrap())
}

fn table(s: &Scratch, text: &str) -> Result<Value, SprayError> {
    s.write("pass.csv", text);
    let mesh = wall(s);
    sprayed(s, &s.path("pass.csv"), &["--mesh", &mesh, "--texel", "0.005"])
}

/// Four times as slow it is too thick to stay: as much paint, lower on the wall, with its runs in the report.
#[test]
fn too_slow_a_pass_runs_down() {
    let s = Scratch::new("runs");
    let slow = |k: usize, row: [f64; 8]| Some([0.4 * k as f64, row[1], row[2], row[3], 0.0, 1.0, 0.0, FLOW]);
    let report = table(&s, &pass(&slow)).unwrap();
    let figure = |name: &str| report[name].as_f64().unwrap();
    assert!(figure("sagging_share") > 0.1, "{report}");
    // It thins until it dries: fresh paint stays up to 3 / (1200 g) m, 0.35 of that when it is dry; what has dried before stays thicker.
    let flat_out = 4.0 * FLOW / (0.2 * 0.025 * std::f64::consts::TAU.sqrt());
    assert!(figure("thickness_max_m") < 0.75 * flat_out, "{report}");
    let books = figure("paint_emitted_kg") - figure("paint_deposited_kg") - figure("paint_overspray_kg");
    assert!(books.abs() < 1e-12, "{books}");
    assert_eq!(table(&Scratch::new("stays"), &pass(&|_, row| Some(row))).unwrap()["sagging_share"], 0.0);
}

/// Along a straight pass the thickness in the middle is `Q / (v d tan(sigma) sqrt(2 pi))`, and no paint is lost.
#[test]
fn a_straight_pass_leaves_the_thickness_of_the_closed_form() {
    let s = Scratch::new("pass");
    let report = table(&s, &pass(&|_, row| Some(row))).unwrap();
    let figure = |name: &str| report[name].as_f64().unwrap();
    let expected = FLOW / (0.2 * 0.025 * std::f64::consts::TAU.sqrt());
    let efficiency = figure("paint_deposited_kg") / figure("paint_emitted_kg");
    let off = figure("thickness_max_m") / (efficiency * expected) - 1.0;
    assert!(off.abs() < 0.02, "{off}: {report}");
    assert!((figure("paint_emitted_kg") / (FLOW * 4.0 * 1200.0) - 1.0).abs() < 1e-6, "{report}");
    let books = figure("paint_emitted_kg") - figure("paint_deposited_kg") - figure("paint_overspray_kg");
    assert!(books.abs() < 1e-12, "{books}");
    for file in ["painted.glb", "painted.obj", "painted.png", "painted_view.png", "painted_1_of_8.png"] {
        assert!(s.0.join("out").join(file).exists(), "{file} is missing");
    }
}

/// The same paint in another light: warmer at dusk than at noon, from more places; the figures stay.
#[test]
fn light_changes_the_pictures_and_nothing_else() {
    let s = Scratch::new("light");
    s.write("pass.csv", pass(&|_, row| Some(row)));
    let mesh = wall(&s);
    let mut redness = Vec::new();
    let mut figures = Vec::new();
    for light in ["noon", "dusk"] {
        let more = ["--mesh", &mesh, "--light", light, "--gloss", "0.3", "--turntable", "2"];
        let report = sprayed(&s, &s.path("pass.csv"), &more).unwrap();
        figures.push(report["thickness_mean_m"].clone());
        let picture = image::open(s.0.join("out/painted_view.png")).unwrap().to_rgb8();
        let sum = |c: usize| picture.pixels().map(|pixel| f64::from(pixel.0[c])).sum::<f64>();
        redness.push(sum(0) / sum(2));
        for file in ["views.png", "turntable.png"] {
            assert!(s.0.join("out").join(file).exists(), "{file} is missing");
        }
    }
    assert_eq!(figures[0], figures[1]);
    assert!(redness[1] > 1.05 * redness[0], "{redness:?}");
}

#[test]
fn gaps_stay_bare_and_stamps_that_go_back_are_left_out() {
    let s = Scratch::new("gap");
    // Two seconds are missing; two stamps repeat.
    let report = table(&s, &pass(&|k, row| (!(10..30).contains(&k)).then_some(row))).unwrap();
    assert_eq!((report["gaps"].as_u64(), report["samples_left_out"].as_u64()), (Some(1), Some(0)));
    assert!((report["paint_emitted_kg"].as_f64().unwrap() / (FLOW * 1.9 * 1200.0) - 1.0).abs() < 1e-6, "{report}");
    let report = table(
        &s,
        &pass(&|k, mut row| {
            row[0] -= if k == 7 || k == 20 { 0.15 } else { 0.0 };
            Some(row)
        }),
    )
    .unwrap();
    assert_eq!((report["gaps"].as_u64(), report["samples_left_out"].as_u64()), (Some(0), Some(2)));
}

#[test]
fn motions_that_make_no_sense_are_refused() {
    let s = Scratch::new("motions");
    for (text, expected) in [
        (pass(&|_, row| Some(row)).replace("axis_z", "z_axis"), "no column axis_z"),
        (pass(&|k, row| (k == 0).then_some(row)), "fewer than two"),
        (pass(&|_, row| Some(row)).replace("0.4,0.0,1.0", "0.4,0.0,x"), "line 2: column axis_y"),
        (
            pass(&|_, mut row| {
                row[5] = 0.0;
                Some(row)
            }),
            "no length",
        ),
        (
            pass(&|_, mut row| {
                row[7] = -1.0;
                Some(row)
            }),
            "below zero",
        ),
        // Inside the wall, looking out.
        (
            pass(&|_, mut row| {
                row[2] = 0.02;
                row[5] = -1.0;
                Some(row)
            }),
            "behind the surface",
        ),
        (String::new(), "is empty"),
    ] {
        let error = table(&s, &text).unwrap_err().to_string();
        assert!(error.contains(expected) && error.contains("pass.csv"), "{error}, expected {expected}");
    }
}

/// What a mission has flown, sprayed again from its table and from its recording.
#[test]
fn flights_are_sprayed_again_from_what_they_leave() {
    let s = Scratch::new("again");
    let mesh = wall(&s);
    let scale = Some(paintcopter::mesh_frame::MeshScale::Factor(1.0));
    let mut mission = MissionFile { mesh: Some(PathBuf::from(&mesh)), scale, ..MissionFile::default() };
    mission.design = Some("gradient".into());
    let flown = s.0.join("flown");
    mission.begin_run(&flown, "test").unwrap();
    let coats = Coats::run(mission.decide_coats(&flown).unwrap()).unwrap();
    let report = save(coats.missions().next().unwrap().1, &flown).unwrap();
    for (file, within) in [("trajectory.csv", 0.02), ("mission.mcap", 0.04)] {
        let again = sprayed(&s, flown.join(file).to_str().unwrap(), &["--mesh", &mesh, "--placed"]).unwrap();
        for (name, flown) in
            [("paint_emitted_kg", report.paint_emitted_kg), ("paint_deposited_kg", report.paint_deposited_kg)]
        {
            let share = again[name].as_f64().unwrap() / flown;
            assert!((share - 1.0).abs() < within, "{file}: {name} is {share} of what was flown");
        }
    }
}

/// On a wall with a ledge that throws shadows: the same files as by the processor. A build without it says so.
#[test]
fn a_gpu_leaves_the_same_files() {
    let s = Scratch::new("gpu");
    let profile = [[0.0, 0.0], [0.0, 0.37], [-0.04, 0.37], [-0.04, 0.43], [0.0, 0.43], [0.0, 0.8]];
    let corners = profile.iter().map(|[y, z]| format!("v 0 {y} {z}\nv 1.2 {y} {z}\n"));
    let strip = |k: usize| format!("f {} {} {} {}\n", 2 * k + 1, 2 * k + 2, 2 * k + 4, 2 * k + 3);
    s.write("ledge.obj", corners.chain((0..5).map(strip)).collect::<String>());
    s.write("pass.csv", pass(&|_, row| Some(row)));
    let (mesh, nozzle) = (s.path("ledge.obj"), s.path("pass.csv"));
    let files = |more: &[&str]| {
        let line = ["--mesh", &mesh, "--light", "noon"];
        let report = sprayed(&s, &nozzle, &[&line, more].concat())?;
        let read = |name| std::fs::read(s.0.join("out").join(name)).unwrap();
        let pictures = ["painted.png", "painted.glb", "painted_view.png", "views.png"].map(read);
        Ok::<_, SprayError>((report, pictures))
    };
    let (report, pictures) = files(&[]).unwrap();
    match files(&["--gpu"]) {
        Ok(on_gpu) => assert!(on_gpu == (report, pictures), "{}", on_gpu.0),
        Err(SprayError::NoGpu) if !cfg!(feature = "gpu") => {}
        Err(error) if std::env::var_os("PAINTCOPTER_REQUIRE_GPU").is_none_or(|v| v != "1") => {
            println!("skipped: {error}");
        }
        Err(error) => panic!("{error}"),
    }
}
