//! The binary `handheld`: the loop on a small object, bad input, and that threads change nothing.

use std::fmt::Write as _;
use std::path::Path;

use clap::Parser as _;
use nalgebra::Isometry3;
use paint_sim::gantry_robot::{HandMotion, HandSettings, PoseSensorSettings};
use paintcopter::handheld::cube::{cube, cube_edges, in_circle, upper_faces};
use paintcopter::handheld::{
    Arguments, HandPoses, HandheldError, HandheldSettings, HardwareSettings, PaintJob, PaintObject, PaintingLog,
    Processor, evaluate, paint, passes, run,
};

use crate::scratch::Scratch;

fn painted_cube() -> PaintObject {
    let wanted = &mut |at: &_| if in_circle(at) { 20e-6 } else { 0.0 };
    PaintObject::new(&cube(), &cube_edges(), 1e-3, wanted).unwrap()
}

/// Paints before the first circle for a few seconds.
fn session(
    object: &PaintObject,
    settings: &HandheldSettings,
    session: &HardwareSettings,
    pose: &dyn Fn(f64) -> Isometry3<f64>,
    seconds: f64,
) -> Result<PaintingLog, HandheldError> {
    let droplets = settings.density_droplets()?;
    let mut device = Processor { surface: &object.surface, droplets, threads: settings.threads };
    let job = PaintJob::new(&object.surface, settings)?;
    let hand = HandPoses { pose, tracked: &|_| true, duration: seconds };
    paint(object, &job, &mut device, session, &hand, &|_| ())
}

/// To and fro before the first circle, without tremor.
fn sweeps(object: &PaintObject, settings: &HandheldSettings) -> impl Fn(f64) -> Isometry3<f64> + use<> {
    let middle = passes(object, settings, None)[0].middle;
    move |t: f64| middle * Isometry3::translation(0.0, -0.025 * (4.0 * t).cos(), 0.0)
}

#[test]
fn the_cube_has_three_circles_of_34_millimetres() {
    let object = painted_cube();
    let area: f64 = object.wanted_points().map(|(_, area)| area).sum();
    assert!((area / (3.0 * std::f64::consts::PI * 0.017 * 0.017) - 1.0).abs() < 0.01, "{area}");
    let whole: f64 = object.texels.area_m2.iter().sum();
    assert!((whole - 6.0 * 0.06 * 0.06).abs() < 1e-9);
    assert!(object.remarks.is_empty(), "{:?}", object.remarks);
    // The upper faces look up by 35.26 degrees, and each is a side to stand before.
    assert!(upper_faces().iter().all(|face| (face.normal.z - (1.0_f64 / 3.0).sqrt()).abs() < 1e-9));
    let passes = passes(&object, &HandheldSettings::default(), Some(10.0));
    assert_eq!(passes.len(), 3);
    assert!(passes.iter().all(|pass| (pass.half_width - 0.027).abs() < 1e-3));
}

#[test]
fn a_perfectly_known_robot_paints_the_circle_and_any_number_of_threads_paints_the_same() {
    let object = painted_cube();
    let known = HardwareSettings {
        pose_sensor: PoseSensorSettings {
            position_sigma: 0.0,
            rotation_sigma: 0.0,
            loss_rate: 0.0,
            ..PoseSensorSettings::default()
        },
        registration: None,
        ..HardwareSettings::default()
    };
    let run = |threads: usize| {
        let settings = HandheldSettings { threads, ..HandheldSettings::default() };
        session(&object, &settings, &known, &sweeps(&object, &settings), 8.0).unwrap()
    };
    let (one, three) = (run(1), run(3));
    assert!(one.truth == three.truth && one.belief == three.belief && one.messages == three.messages);
    let figures = one.truth.figures();
    // In 8 s at most 8 s of flow fly; the circle is a third of the target.
    assert!(figures.inside > 0.03 && figures.inside < 8.0 * 0.5e-9 / 5.4e-8, "{figures:?}");
    assert!(figures.outside < 0.1 * figures.inside, "{figures:?}");
    // What the robot believes is what is there.
    let believed = one.belief.figures();
    assert!((believed.inside - figures.inside).abs() < 0.1 * figures.inside, "{believed:?} {figures:?}");
    assert_eq!((one.lost_ticks, one.limit_hits), (0, 0));
}

#[test]
fn lost_markers_shut_the_valve_within_a_step_and_are_said() {
    let object = painted_cube();
    let settings = HandheldSettings::default();
    let losing = HardwareSettings {
        pose_sensor: PoseSensorSettings { loss_rate: 1.0, loss_duration: 0.5, ..PoseSensorSettings::default() },
        registration: None,
        ..HardwareSettings::default()
    };
    let log = session(&object, &settings, &losing, &sweeps(&object, &settings), 8.0).unwrap();
    assert!(log.lost_ticks > 50 && log.held_decisions > 5, "{} {}", log.lost_ticks, log.held_decisions);
    assert!(log.shut_after_loss <= 0.01, "{}", log.shut_after_loss);
    // From the second tick without a pose on nothing flies: the valve takes 4 ms.
    let mut lost = 0;
    for tick in &log.ticks {
        lost = if tick.tracked { 0 } else { lost + 1 };
        assert!(lost < 2 || tick.open == 0.0, "{}", tick.time);
    }
    assert!(log.ticks.iter().any(|tick| tick.open > 0.0));
    let said = log.messages.iter().filter(|(_, text)| text.contains("markers lost")).count();
    let losses = log.ticks.windows(2).filter(|pair| pair[0].tracked && !pair[1].tracked).count();
    assert_eq!(said, losses + usize::from(!log.ticks[0].tracked));
}

#[test]
fn a_misplaced_object_is_found_by_its_distances() {
    let object = painted_cube();
    let settings = HandheldSettings::default();
    let away = Isometry3::translation(4e-3, -3e-3, 2e-3);
    // Before all three sides in turn: one alone does not say where the object stands along it.
    let hand = HandMotion::new(&passes(&object, &settings, Some(5.0)), HandSettings::default(), 3).unwrap();
    let error = |registration| {
        let misplaced = HardwareSettings { registration, world_from_model: away, ..HardwareSettings::default() };
        session(&object, &settings, &misplaced, &|time| hand.at(time), hand.duration()).unwrap().registration_error
    };
    let before = error(None);
    assert!((before - 29.0_f64.sqrt() * 1e-3).abs() < 1e-9);
    let after = error(HardwareSettings::default().registration);
    assert!(after < 0.4 * before, "{after} {before}");
}

#[test]
fn the_path_ranks_among_the_best_of_all() {
    let object = painted_cube();
    let settings = HandheldSettings::default();
    let droplets = settings.density_droplets().unwrap();
    let mut device = Processor { surface: &object.surface, droplets, threads: 2 };
    let found = evaluate(&object, &upper_faces(), &mut device, &settings, (6, 7..8), &|_| ()).unwrap();
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    assert_eq!(found.paths, [2187; 6]);
    assert!(mean(&found.ranks) <= 0.05 && mean(&found.beam_ranks) <= 0.01, "{found:?}");
    assert!(mean(&found.random_ranks) > 0.2, "{found:?}");
}

fn arguments(scratch: &Scratch, more: &[&str]) -> Arguments {
    let out = scratch.path("out");
    let words = ["handheld", "--out", out.as_str(), "--threads", "2"];
    Arguments::parse_from(words.iter().chain(more))
}

/// A plate of 60 mm that faces -x with a hole in it, and a needle of a triangle beside it.
fn broken_mesh(scratch: &Scratch) -> String {
    let vertices = "v 0 0 0\nv 0 0.06 0\nv 0 0.06 0.06\nv 0 0 0.06\nv 0 0.02 0.02\nv 0 0.04 0.02\nv 0 0.04 0.04\nv 0 0.02 0.04\n\
                    v 0 0.03 0.06\nv 0 0.03 0.09\nv 0 0.03005 0.09\nv 0 0.05 0.09\nv 0 0.05 0.09\nv 0 0.05 0.09\n";
    let quads = [[1, 4, 8, 5], [4, 3, 7, 8], [3, 2, 6, 7], [2, 1, 5, 6]];
    let mut text = vertices.to_string();
    for [a, b, c, d] in quads {
        let _ = write!(text, "f {a} {b} {c}\nf {a} {c} {d}\n");
    }
    text += "f 9 10 11\nf 12 13 14\n";
    scratch.write("plate.obj", text);
    scratch.path("plate.obj")
}

fn report(folder: &Path) -> serde_json::Value {
    serde_json::from_str(&std::fs::read_to_string(folder.join("report.json")).unwrap()).unwrap()
}

#[test]
fn a_plate_with_a_hole_is_painted_and_its_recording_replayed() {
    let scratch = Scratch::new("handheld-plate");
    let (mesh, blank) = (broken_mesh(&scratch), scratch.path("blank.png"));
    let mesh = mesh.as_str();
    image::GrayImage::from_pixel(7, 5, image::Luma([0])).save(&blank).unwrap();
    // A picture of another size is refused with the size that is wanted, and the atlas to paint on is there.
    let wrong = run(&arguments(&scratch, &["--mesh", mesh, "--target", &blank, "--texel", "0.002"]));
    let Err(HandheldError::TargetSize { wanted_w, wanted_h, .. }) = wrong else { panic!("{wrong:?}") };
    let atlas = image::open(scratch.path("out/atlas.png")).unwrap().to_luma8();
    assert_eq!((atlas.width() as usize, atlas.height() as usize), (wanted_w, wanted_h));
    // All that is white on the atlas shall be painted.
    let target = scratch.path("target.png");
    let black = image::GrayImage::from_fn(atlas.width(), atlas.height(), |x, y| {
        image::Luma([if atlas.get_pixel(x, y).0[0] == 255 { 0 } else { 255 }])
    });
    black.save(&target).unwrap();
    let few = ["--mesh", mesh, "--target", &target, "--texel", "0.002", "--seconds", "4", "--flow", "1e-8"];
    let painted = run(&arguments(&scratch, &few));
    // Four seconds are too few; the results are there all the same.
    assert!(matches!(painted, Err(HandheldError::Unfinished { .. })), "{painted:?}");
    let out = scratch.0.join("out");
    for name in ["target.png", "painted.png", "difference.png", "density.png", "handheld.mcap", "report.json"] {
        assert!(std::fs::metadata(out.join(name)).unwrap().len() > 100, "{name}");
    }
    let first = report(&out);
    assert!(first["paint_inside_fraction"].as_f64().unwrap() > 0.02, "{first}");
    // The poses of the recording move the robot the same way again.
    let recording = scratch.path("motion.mcap");
    std::fs::copy(out.join("handheld.mcap"), &recording).unwrap();
    let mut again = few.to_vec();
    again.extend(["--motion", recording.as_str()]);
    let _ = run(&arguments(&scratch, &again));
    let second = report(&out);
    let inside = |report: &serde_json::Value| report["paint_inside_fraction"].as_f64().unwrap();
    assert!((inside(&first) / inside(&second) - 1.0).abs() < 0.2, "{first} {second}");
}

#[test]
fn bad_input_is_refused_in_one_line() {
    let scratch = Scratch::new("handheld-bad");
    let line = |more: &[&str]| run(&arguments(&scratch, more)).unwrap_err().to_string();
    assert!(line(&["--pose-noise", "0"]).starts_with("--pose-noise 0: must be positive"));
    assert!(line(&["--directions", "4"]).contains("odd number"));
    assert!(line(&["--motion", "nothing.mcap"]).contains("nothing.mcap: cannot be read"));
    scratch.write("no.mcap", "these are no poses");
    assert!(line(&["--motion", &scratch.path("no.mcap")]).contains("no sound MCAP file"));
    let mesh = broken_mesh(&scratch);
    assert!(line(&["--mesh", &mesh, "--target", "none.png"]).contains("none.png: cannot be read"));
}

/// A motion as TUM text: poses at `rate` Hz for `seconds`, in units of `unit`
/// metres.
fn tum_text(pose: &dyn Fn(f64) -> Isometry3<f64>, rate: f64, seconds: f64, unit: f64) -> String {
    let mut text = String::from("# timestamp tx ty tz qx qy qz qw\n");
    for k in 0..=(seconds * rate) as usize {
        let t = k as f64 / rate;
        let pose = pose(t);
        let (p, q) = (pose.translation.vector / unit, pose.rotation.coords);
        let _ = writeln!(text, "{} {} {} {} {} {} {} {}", 1000.0 + t, p.x, p.y, p.z, q.x, q.y, q.z, q.w);
    }
    text
}

#[test]
fn recorded_motions_of_any_rate_unit_and_frame_move_the_robot() {
    let scratch = Scratch::new("handheld-motion");
    let object = painted_cube();
    let hand = sweeps(&object, &HandheldSettings::default());
    let figures = |text: &str, more: &[&str]| {
        scratch.write("motion.txt", text);
        let motion = scratch.path("motion.txt");
        let words = [&["--motion", motion.as_str(), "--flow", "2e-9"], more].concat();
        let done = run(&arguments(&scratch, &words));
        assert!(matches!(done, Err(HandheldError::Unfinished { .. })), "{done:?}");
        let report = report(&scratch.0.join("out"));
        ["paint_inside_fraction", "tracking_lost_s", "pose_jumps", "painting_s"]
            .map(|key| report[key].as_f64().unwrap())
    };
    let slow = figures(&tum_text(&hand, 20.0, 4.0, 1.0), &[]);
    let fast = figures(&tum_text(&hand, 1000.0, 4.0, 1.0), &[]);
    assert!(fast[0] > 0.05 && (slow[0] / fast[0] - 1.0).abs() < 0.2, "{slow:?} {fast:?}");
    assert!((slow[3] - 4.0).abs() < 0.2 && (fast[3] - 4.0).abs() < 0.2);
    // A camera, in millimetres, of a world that lies elsewhere and is turned.
    let robot_from_camera = nalgebra::Matrix3::new(0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0);
    let camera = nalgebra::UnitQuaternion::from_matrix(&robot_from_camera);
    let other = Isometry3::new(nalgebra::Vector3::new(7.0, -3.0, 1.0), nalgebra::Vector3::new(0.3, -1.0, 2.0));
    let filmed = tum_text(&|t| other * hand(t) * camera, 100.0, 4.0, 1e-3);
    let placed = figures(&filmed, &["--motion-scale", "0.001", "--motion-axes", "camera", "--place-motion"]);
    assert!((placed[0] / fast[0] - 1.0).abs() < 0.35, "{placed:?} {fast:?}");
    // Half a second without poses, and a tracker that is 0.4 m off for a while: no paint meanwhile, and both are said.
    let astray =
        |t: f64| if (2.0..2.5).contains(&t) { Isometry3::translation(0.0, 0.4, 0.0) * hand(t) } else { hand(t) };
    let whole = tum_text(&astray, 100.0, 4.0, 1.0);
    let holed: Vec<&str> =
        whole.lines().filter(|line| !(line.starts_with("1001.2") || line.starts_with("1001.3"))).collect();
    let holed = figures(&holed.join("\n"), &[]);
    assert!(holed[1] >= 0.2 && holed[2] >= 1.0 && holed[0] > 0.02, "{holed:?}");
}

#[test]
fn a_motion_that_moves_no_robot_is_refused_with_the_way_out() {
    let scratch = Scratch::new("handheld-no-motion");
    let hand = sweeps(&painted_cube(), &HandheldSettings::default());
    let line = |name: &str, bytes: &[u8], more: &[&str]| {
        scratch.write(name, bytes);
        let motion = scratch.path(name);
        let words = [&["--motion", motion.as_str()], more].concat();
        run(&arguments(&scratch, &words)).unwrap_err().to_string()
    };
    let good = tum_text(&hand, 50.0, 2.0, 1.0);
    let nan = good.replacen(" 0", " NaN", 1);
    assert!(line("nan.txt", nan.as_bytes(), &[]).contains("not a finite number"));
    assert!(line("packed.txt", &[0x1f, 0x8b, 8, 0], &[]).contains("gunzip"));
    assert!(line("binary.txt", &[0xff, 0xfe, 0, 1], &[]).contains("neither MCAP nor text"));
    assert!(line("kitti.txt", b"1 0 0 0 0 1 0 0 0 0 1 0\n", &[]).contains("expected 8"));
    assert!(line("one.txt", b"1 0 0 0 0 0 0 1\n", &[]).contains("fewer than two poses"));
    assert!(line("few.txt", b"1 0 0 0 0 0 0 1\n1.02 0 0 0 0 0 0 1\n", &[]).contains("knots"));
    assert!(line("slow.txt", tum_text(&hand, 2.0, 10.0, 1.0).as_bytes(), &[]).contains("record it at 10 Hz"));
    assert!(line("mm.txt", tum_text(&hand, 50.0, 2.0, 1e-3).as_bytes(), &[]).contains("--motion-scale"));
    let turned = line("back.txt", good.replace("\n1000.5 ", "\n900 ").as_bytes(), &[]);
    assert!(turned.contains("line"), "{turned}");
    // Far away: how far is said.
    let far = tum_text(&|t| Isometry3::translation(2.0, 0.0, 0.0) * hand(t), 50.0, 2.0, 1.0);
    let far = line("far.txt", far.as_bytes(), &[]);
    let nearest =
        far.split("no nearer to it than ").nth(1).and_then(|rest| rest.split(' ').next()?.parse::<f64>().ok());
    assert!(nearest.is_some_and(|metres| (metres - 1.95).abs() < 0.1), "{far}");
    assert!(
        line("scale.txt", good.as_bytes(), &["--motion-scale", "0"]).contains("--motion-scale 0: must be positive")
    );
}

#[test]
fn holes_and_thin_faces_of_a_mesh_are_said() {
    let scratch = Scratch::new("handheld-remarks");
    let mesh = paintcopter::mesh_io::read_mesh(Path::new(&broken_mesh(&scratch))).unwrap();
    let object = PaintObject::new(&mesh, &[], 2e-3, &mut |_| 20e-6).unwrap();
    let said = |what: &str| object.remarks.iter().any(|remark| remark.contains(what));
    assert!(said("thinner than 1 : 100") && said("have no area") && said("one face only"), "{:?}", object.remarks);
}

#[test]
fn a_target_out_of_reach_is_said() {
    let object = painted_cube();
    let settings = HandheldSettings::default();
    // Two metres off, looking away.
    let far = |_: f64| Isometry3::translation(2.0, 0.0, 0.0);
    let log = session(&object, &settings, &HardwareSettings::default(), &far, 2.0).unwrap();
    assert!(log.emitted == 0.0 && log.idle_decisions == log.decision_ms.len() && log.idle_decisions > 10);
}

#[test]
fn a_camera_alone_paints_too() {
    let scratch = Scratch::new("handheld-camera");
    let painted = run(&arguments(&scratch, &["--no-inertial", "--seconds", "3"]));
    assert!(matches!(painted, Err(HandheldError::Unfinished { .. })), "{painted:?}");
    let report = report(&scratch.0.join("out"));
    let figure = |name: &str| report[name].as_f64().unwrap();
    assert!(figure("paint_inside_fraction") > 0.01 && figure("held_decisions") < 0.5 * figure("decisions"), "{report}");
}
