//! The whole job on a panel of one square metre: what it leaves behind, and that its picture and its limits go all the way
//! through it. The missions are run once for all tests.

use std::collections::BTreeMap;
use std::sync::OnceLock;

use paintcopter::design::{Design, Picture};
use paintcopter::mesh_io::{MeshUv, TriangleMesh, read_mesh};
use paintcopter::mission::{Mission, MissionSettings, PaintingTask, save};
use paintcopter::region::Scene;
use paintcopter::report::Report;

use crate::scratch::Scratch;

/// The most that the valve gives, m³/s: so little that strokes must be flown more slowly for it.
const MAX_FLOW: f64 = 0.1e-6;

/// A panel 1.2 m wide and 0.8 m high with a soft bulge, facing -x, its lower edge 2 m up. Texture coordinates run from its
/// left to its right as the robot sees it, and upwards.
fn panel() -> TriangleMesh {
    let (columns, rows) = (24_u32, 16_u32);
    let (mut mesh, mut uv) = (TriangleMesh::default(), MeshUv::default());
    for row in 0..=rows {
        for column in 0..=columns {
            let (u, v) = (f64::from(column) / f64::from(columns), f64::from(row) / f64::from(rows));
            let bulge = 0.08 * (std::f64::consts::PI * u).sin() * (std::f64::consts::PI * v).sin();
            mesh.positions.push([-bulge as f32, (0.6 - 1.2 * u) as f32, (2.0 + 0.8 * v) as f32]);
            uv.coordinates.push([u as f32, v as f32]);
        }
    }
    for row in 0..rows {
        for column in 0..columns {
            let at = |r: u32, c: u32| r * (columns + 1) + c;
            let [a, b, c, d] = [at(row, column), at(row, column + 1), at(row + 1, column + 1), at(row + 1, column)];
            mesh.faces.extend([[a, b, c], [a, c, d]]);
        }
    }
    uv.faces.clone_from(&mesh.faces);
    mesh.uv = Some(uv);
    mesh
}

/// A picture that is dark at its upper left and fades to the right and downwards.
fn picture(s: &Scratch) -> Picture {
    let side = 64;
    let shade =
        |x: u32, y: u32| 255.0 * (1.0 - f64::from((side - 1 - x) * (side - 1 - y)) / f64::from((side - 1).pow(2)));
    let path = s.0.join("picture.png");
    image::GrayImage::from_fn(side, side, |x, y| image::Luma([shade(x, y) as u8])).save(&path).unwrap();
    Picture::open(&path).unwrap()
}

struct Painted {
    mission: Mission,
    report: Report,
    files: BTreeMap<&'static str, Vec<u8>>,
}

/// Files that a mission leaves, without those that hold times.
const FILES: [&str; 13] = [
    "trajectory.csv",
    "wanted.png",
    "painted.png",
    "painted_view.png",
    "progress.png",
    "error.png",
    "path.png",
    "angles.png",
    "surface.ply",
    "scan.ply",
    "mission.mcap",
    "drift_true.tum",
    "drift_estimated.tum",
];

fn paint(threads: usize) -> Painted {
    let s = Scratch::new("mission");
    let mut settings = MissionSettings { seed: 3, threads, ..MissionSettings::default() };
    settings.planner.timing.max_flow = MAX_FLOW;
    let mission = PaintingTask::new("panel", &Scene::whole(panel()), &Design::Texture(picture(&s)), settings)
        .and_then(Mission::run)
        .unwrap();
    let report = save(&mission, &s.0).unwrap();
    let read = |name: &'static str| (name, std::fs::read(s.0.join(name)).unwrap());
    let files = FILES.into_iter().chain(["report.json"]).map(read).collect();
    Painted { mission, report, files }
}

/// The mission of seed 3 on one thread.
fn painted() -> &'static Painted {
    static PAINTED: OnceLock<Painted> = OnceLock::new();
    PAINTED.get_or_init(|| paint(1))
}

#[test]
fn a_panel_is_painted_and_the_figures_are_those_of_an_easy_one() {
    let Painted { report, files, .. } = painted();
    assert!((report.surface_area_m2 - 0.99).abs() < 0.04, "{}", report.surface_area_m2);
    assert_eq!((report.uv_flips, report.collisions, report.limit_violations), (0, 0, 0));
    assert_eq!(report.mass_balance_relative, 0.0);
    assert!(report.hit_error_rms_m < 0.015 && report.normal_deviation_max_m < 0.02);
    assert!(report.ssim_painted > 0.9 * report.ssim_canvas && report.psnr_painted_db > 25.0);
    assert!(report.scan_error_mean_m < 0.005);
    let json: serde_json::Value = serde_json::from_slice(&files["report.json"]).unwrap();
    assert!(json.as_object().unwrap().len() >= 33);
}

/// The figures of the joints are those of the joints, and the table says what was planned and flown.
#[test]
fn joints_are_not_confused() {
    let Painted { mission, report, files } = painted();
    let flight = mission.flights().first().unwrap();
    let open: Vec<_> =
        flight.flight.samples.iter().filter(|s| s.flow > 0.0 && s.aim.is_some() && s.hit.is_some()).collect();
    let rms = |joint: usize| {
        let squares = open.iter().map(|s| (s.pan_tilt[joint] - s.desired_pan_tilt[joint]).powi(2));
        (squares.sum::<f64>() / open.len() as f64).sqrt()
    };
    assert!((report.pan_error_rms_rad - rms(0)).abs() < 1e-12 && (report.tilt_error_rms_rad - rms(1)).abs() < 1e-12);
    assert!((rms(0) - rms(1)).abs() > 1e-6, "the two differ");

    let table = std::str::from_utf8(&files["trajectory.csv"]).unwrap();
    let names: Vec<&str> = table.lines().next().unwrap().split(',').collect();
    for row in table.lines().skip(1).step_by(97) {
        let numbers: Vec<f64> = row.split(',').map(|cell| cell.parse().unwrap()).collect();
        let column = |name: &str| numbers[names.iter().position(|n| *n == name).unwrap()];
        let time = column("time_s");
        let planned = flight.plan.setpoint(time);
        for (name, value) in [
            ("x_m", planned.sample.position.x),
            ("heading_rad", planned.sample.heading),
            ("pan_rad", planned.pan),
            ("tilt_rad", planned.tilt),
            ("target_z_m", planned.aim.z),
        ] {
            assert!((column(name) - value).abs() < 1e-8, "{name} at {time}");
        }
        let flown = flight
            .flight
            .samples
            .iter()
            .min_by(|a, b| (a.time - time).abs().total_cmp(&(b.time - time).abs()))
            .unwrap();
        assert!(
            (column("flown_pan_rad") - flown.pan_tilt[0]).abs() < 1e-8
                && (column("flown_tilt_rad") - flown.pan_tilt[1]).abs() < 1e-8
        );
    }
}

#[test]
fn the_threads_leave_no_trace() {
    let (one, three) = (painted(), paint(3));
    for name in FILES {
        assert!(one.files[name] == three.files[name], "{name} depends on the number of threads");
    }
}

/// Dark where the picture is dark, on the painted mesh and on what a camera sees of it: neither mirrored nor upside down.
#[test]
fn a_picture_stands_upright_on_the_mesh_and_in_the_camera() {
    for name in ["surface.ply", "scan.ply"] {
        let s = Scratch::new("upright");
        s.write(name, &painted().files[name]);
        let mesh = read_mesh(&s.0.join(name)).unwrap();
        let colours = mesh.colours.unwrap();
        // The robot looks along x: left is +y.
        let quarter = |left: bool, top: bool| {
            let inside = |p: &[f32; 3]| (p[1] > 0.2) == left && p[1].abs() > 0.2 && (p[2] > 2.5) == top;
            let greens: Vec<f32> =
                mesh.positions.iter().zip(&colours).filter(|(p, _)| inside(p)).map(|(_, c)| c[1]).collect();
            greens.iter().sum::<f32>() / greens.len() as f32
        };
        let dark = quarter(true, true);
        let others = [quarter(true, false), quarter(false, true), quarter(false, false)];
        assert!(others.iter().all(|other| *other > dark + 0.1), "{name}: {dark} at the upper left, {others:?}");
    }
}

#[test]
fn the_valve_never_gives_more_than_the_mission_allows_and_reaches_it() {
    let mut most = 0.0_f64;
    for f in painted().mission.flights() {
        let steps = (f.plan.trajectory.duration() / 0.01) as usize;
        let planned = (0..=steps).map(|k| f.plan.setpoint(0.01 * k as f64).flow).fold(0.0, f64::max);
        let flown = f.flight.samples.iter().map(|sample| sample.flow).fold(0.0, f64::max);
        assert!(planned <= MAX_FLOW * (1.0 + 1e-9) && flown <= MAX_FLOW * (1.0 + 1e-9), "{planned} {flown}");
        most = most.max(planned);
    }
    assert!(most > 0.99 * MAX_FLOW, "{most}: the limit does not bind, so this test says nothing");
}
