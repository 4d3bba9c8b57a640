//! What is wrong with a recording is named; what a run leaves out is counted.

use std::fmt::Write as _;
use std::io::Read as _;
use std::path::Path;

use flate2::read::MultiGzDecoder;
use paintcopter::vio::{Images, Overrides, RunSettings, open_euroc, run, simulate};
use vio_ekf::run::evaluate_run;

use super::fixtures::{columns, copy, edit, flight, images, run_folder, vio};
use crate::recorded::recorded;
use crate::scratch::Scratch;

#[test]
#[allow(clippy::too_many_lines, reason = "a list of cases")]
fn what_is_wrong_is_named_and_what_is_left_out_is_counted() {
    let sound = Scratch::new("sound");
    simulate(&flight(5.0, false), &sound.0).unwrap();
    let run_on = |name: &str, spoil: &dyn Fn(&Path), mcap: bool| {
        let s = Scratch::new(name);
        copy(&sound.0, &s.0);
        spoil(&s.0);
        let out = s.0.join("out");
        let file = s.0.join("recording.mcap");
        let input = if mcap { ["--mcap", file.to_str().unwrap()] } else { ["--euroc", s.0.to_str().unwrap()] };
        let output = vio(&input, &out);
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(!text.contains("panicked"), "{name}: {text}");
        let report = std::fs::read_to_string(out.join("report.json")).ok();
        let report = report.map(|text| serde_json::from_str::<serde_json::Value>(&text).unwrap());
        (output.status.code(), text, report)
    };
    let refused = |name: &str, spoil: &dyn Fn(&Path), words: &[&str]| {
        let (code, text, report) = run_on(name, spoil, name.starts_with("mcap"));
        assert!(code == Some(1) && report.is_none(), "{name}: {code:?} {text}");
        let line = text.lines().find(|l| l.starts_with("vio: ")).unwrap_or_else(|| panic!("{name}: no line in {text}"));
        for word in words {
            assert!(line.contains(word), "{name}: \"{word}\" is missing in: {line}");
        }
    };
    let counted = |name: &str, spoil: &dyn Fn(&Path), skipped: u64| {
        let (code, text, report) = run_on(name, spoil, false);
        let report = report.unwrap_or_else(|| panic!("{name}: {text}"));
        assert_eq!(code, Some(0), "{name}: {text}");
        assert_eq!(report["frames_skipped"], skipped, "{name}: {text}");
        assert_eq!(report["diverged"], false, "{name}");
    };

    counted("sound-itself", &|_| {}, 0);
    counted("missing", &|f| images(f)[20..25].iter().for_each(|p| std::fs::remove_file(p).unwrap()), 5);
    counted("corrupt", &|f| std::fs::write(&images(f)[30], "PNG").unwrap(), 1);
    counted(
        "cut-off",
        &|f| {
            let bytes = std::fs::read(&images(f)[31]).unwrap();
            std::fs::write(&images(f)[31], &bytes[..bytes.len() / 2]).unwrap();
        },
        1,
    );
    counted("one-small", &|f| image::GrayImage::new(16, 16).save(&images(f)[40]).unwrap(), 1);

    let imu = |change: &'static dyn Fn(&mut Vec<String>)| {
        move |f: &Path| edit(f, "imu0/data.csv", |text| columns(text, change))
    };
    refused(
        "no-images",
        &|f| std::fs::remove_dir_all(f.join("mav0/cam0/data")).unwrap(),
        &["none of the 100 images", ".png"],
    );
    refused("no-folder", &|f| std::fs::remove_dir_all(f.join("mav0/imu0")).unwrap(), &["mav0/cam0 and mav0/imu0"]);
    refused(
        "size",
        &|f| edit(f, "cam0/sensor.yaml", |t| t.replace("[376, 240]", "[752, 480]")),
        &["(376, 240)", "(752, 480)"],
    );
    refused(
        "nan-value",
        &|f| {
            edit(f, "imu0/data.csv", |t| {
                t.lines()
                    .enumerate()
                    .map(|(k, l)| {
                        if k == 7 { l.rsplit_once(',').unwrap().0.to_string() + ",NaN\n" } else { l.to_string() + "\n" }
                    })
                    .collect()
            });
        },
        &["imu0/data.csv", "line 8", "column 7", "NaN"],
    );
    let unsorted = |text: &str| {
        let mut lines: Vec<&str> = text.lines().collect();
        lines.swap(10, 11);
        lines.join("\n")
    };
    refused("unsorted", &|f| edit(f, "imu0/data.csv", unsorted), &["imu0/data.csv", "line 12", "sort"]);
    refused("unsorted-images", &|f| edit(f, "cam0/data.csv", unsorted), &["cam0/data.csv", "line 12", "sort"]);
    let twice = |text: &str| text.lines().flat_map(|line| [line, line]).collect::<Vec<_>>().join("\n");
    // A sample that is there twice is one sample; an image twice is a mistake of the table.
    counted("twice", &|f| edit(f, "imu0/data.csv", twice), 0);
    refused("images-twice", &|f| edit(f, "cam0/data.csv", twice), &["cam0/data.csv", "sort"]);
    refused(
        "rate",
        &|f| edit(f, "imu0/sensor.yaml", |t| t.replace("rate_hz: 200", "rate_hz: 100")),
        &["200.0 Hz", "100.0 Hz"],
    );
    refused("microseconds", &imu(&|c| c[0] = c[0][..c[0].len() - 3].to_string()), &["Hz", "unit of the stamps"]);
    refused(
        "units",
        &imu(&|c| c[4..].iter_mut().for_each(|v| *v = (v.parse::<f64>().unwrap() / 9.81).to_string())),
        &["m/s²", "unit"],
    );
    refused("clocks", &imu(&|c| c[0] = (c[0].parse::<i64>().unwrap() - 60_000_000_000).to_string()), &["same clock"]);
    refused(
        "calibration",
        &|f| edit(f, "cam0/sensor.yaml", |t| t.replace("intrinsics", "extrinsics")),
        &["sensor.yaml", "intrinsics"],
    );
    refused("mcap-none", &|f| std::fs::write(f.join("recording.mcap"), "MCAP").unwrap(), &["recording.mcap", "MCAP"]);
    refused(
        "mcap-cut",
        &|f| {
            let bytes = std::fs::read(f.join("recording.mcap")).unwrap();
            std::fs::write(f.join("recording.mcap"), &bytes[..bytes.len() / 2]).unwrap();
        },
        &["recording.mcap", "recover"],
    );
    // Noise for pictures: nothing to hold on to, hence no start, and no trajectory that could be believed.
    refused(
        "blind",
        &|f| images(f).iter().for_each(|p| image::GrayImage::from_pixel(376, 240, image::Luma([90])).save(p).unwrap()),
        &["never started"],
    );
}

/// What `vio` says of a folder: exit code, what it writes to stderr, and its report.
#[test]
fn units_and_axes_of_the_inertial_sensor_are_named() {
    let s = Scratch::new("axes");
    simulate(&flight(10.0, false), &s.0).unwrap();
    let samples = std::fs::read_to_string(s.0.join("mav0/imu0/data.csv")).unwrap();
    let spoil = |change: &dyn Fn(&mut Vec<String>)| {
        std::fs::write(s.0.join("mav0/imu0/data.csv"), columns(&samples, change)).unwrap();
    };
    let scale = |values: &mut [String], factor: f64| {
        for v in values {
            *v = (v.parse::<f64>().unwrap() * factor).to_string();
        }
    };
    // Refused before anything runs; taken if that is wanted, and then it does not get far.
    spoil(&|c| scale(&mut c[4..7], 1.0 / 9.81));
    let (code, text, report) = run_folder(&s.0, &[]);
    assert!(code == Some(1) && report.is_none() && text.contains("m/s², not g"), "{text}");
    let (code, text, _) = run_folder(&s.0, &["--accept-imu"]);
    assert!(code == Some(1) && text.contains("warning") && text.contains("taken as they are"), "{text}");
    // The gravity test has nothing to say; the images have.
    spoil(&|c| scale(&mut c[1..4], -1.0));
    let (code, text, report) = run_folder(&s.0, &[]);
    assert_eq!(code, Some(1), "{text}");
    assert!(text.contains("it would go on if the gyroscope's (x, y, z) are (-x, -y, -z)"), "{text}");
    // No pose that the images contradict is left.
    assert!(report.is_none_or(|report| report["poses"].as_u64() < Some(100)), "{text}");
}

/// A flight whose inertial samples stop for a second goes on in a world of its own; one whose samples end early is no success.
#[test]
fn gaps_begin_new_segments_and_half_a_recording_is_no_success() {
    let s = Scratch::new("gap");
    simulate(&flight(9.0, false), &s.0).unwrap();
    let samples = std::fs::read_to_string(s.0.join("mav0/imu0/data.csv")).unwrap();
    let keep = |wanted: &dyn Fn(usize) -> bool| {
        let lines = samples.lines().enumerate().filter(|(k, _)| wanted(*k));
        let text: String = lines.flat_map(|(_, line)| [line, "\n"]).collect();
        std::fs::write(s.0.join("mav0/imu0/data.csv"), text).unwrap();
    };
    keep(&|k| !(900..1100).contains(&k));
    let (code, text, report) = run_folder(&s.0, &[]);
    let report = report.unwrap_or_else(|| panic!("{text}"));
    assert_eq!((code, report["segments"].as_u64(), report["resets"].as_u64()), (Some(0), Some(2), Some(1)), "{text}");
    let written = std::fs::read_to_string(s.0.join("out/trajectory.tum")).unwrap();
    let marks: Vec<&str> = written.lines().filter(|line| line.starts_with('#')).collect();
    assert!(
        matches!(marks[..], [one, two] if one.contains("segment 1 of 2") && two.contains("segment 2 of 2")),
        "{marks:?}"
    );
    // Each is evaluated by itself: the second begins at its own origin, metres from the end of the first.
    assert!(report["ate_yaw_rmse_m"].as_f64() < Some(0.05) && text.contains("2 segments"), "{report}");
    let states = std::fs::read_to_string(s.0.join("out/states.csv")).unwrap();
    let rows: Vec<Vec<f64>> =
        states.lines().skip(1).map(|line| line.split(',').map(|v| v.parse().unwrap()).collect()).collect();
    assert_eq!(rows.len() as u64, report["poses"].as_u64().unwrap());
    assert!(rows.iter().all(|row| row.len() == 20 + 120 && row[20] >= 0.0), "{}", states.lines().next().unwrap());
    assert!(rows[0][1] == 1.0 && rows.last().unwrap()[1] == 2.0);
    // The settings that a run writes are those it reads: with ten landmarks there are never more.
    let written = std::fs::read_to_string(s.0.join("out/settings.toml")).unwrap();
    s.write("ten.toml", written.replace("max_count = 25", "max_count = 10"));
    let ten = s.0.join("ten.toml");
    let (_, text, _) = run_folder(&s.0, &["--settings", ten.to_str().unwrap()]);
    let again = std::fs::read_to_string(s.0.join("out/settings.toml")).unwrap();
    assert_eq!(again, std::fs::read_to_string(&ten).unwrap(), "{text}");
    let states = std::fs::read_to_string(s.0.join("out/states.csv")).unwrap();
    let used = |line: &str| line.split(',').nth(2).unwrap().parse::<usize>().unwrap();
    assert!((5..=10).contains(&states.lines().skip(1).map(used).max().unwrap()));
    s.write("wrong.toml", "gravity = 9.8\n[landmarks]\nmax_cuont = 10\n");
    let wrong = s.0.join("wrong.toml");
    let (code, text, _) = run_folder(&s.0, &["--settings", wrong.to_str().unwrap()]);
    assert!(code == Some(1) && text.contains("wrong.toml") && text.contains("max_cuont"), "{text}");

    keep(&|k| k < 700);
    let (code, text, report) = run_folder(&s.0, &[]);
    let images = report.unwrap_or_else(|| panic!("{text}"))["frames_skipped"].as_u64().unwrap();
    assert!(code == Some(1) && images > 80 && text.contains("of 180 images have a pose"), "{images}: {text}");
}

/// From the fifth second on the images are those of another part of the flight: what they contradict is not output.
#[test]
fn no_pose_is_left_that_the_images_contradict() {
    let s = Scratch::new("contradiction");
    simulate(&flight(9.0, false), &s.0).unwrap();
    let mut recording = open_euroc(&s.0, &Overrides::default()).unwrap();
    let Images::Files(files) = &mut recording.images else { panic!("a folder has files") };
    let sound = files.clone();
    for k in 100..180 {
        files[k].1 = sound[200 - k - 20 + 40].1.clone();
    }
    let found = run(&recording, &RunSettings { threads: 1, quiet: true, ..RunSettings::default() }).unwrap().run;
    let last = found
        .segments
        .iter()
        .flat_map(|segment| &segment.estimates)
        .map(|estimate| estimate.odometry.stamp)
        .max()
        .unwrap();
    eprintln!("{} withdrawn, {:?}", found.withdrawn, found.lost);
    assert!(!found.lost.is_empty() && found.withdrawn > 0, "{:?}", found.lost);
    assert!(last <= sound[101].0, "a pose at {last}, the images are wrong from {} on", sound[100].0);
}

/// A circle, seen in another frame, a centimetre too high and too low in turns: then the error is a centimetre.
#[test]
fn trajectories_are_compared() {
    let s = Scratch::new("eval");
    let (mut reference, mut estimate) = (String::from("# t x y z q\n"), String::new());
    let (sin, cos) = 0.25_f64.sin_cos();
    for k in 0..2000 {
        let angle = 0.01 * f64::from(k);
        let (x, y, z) = (2.0 * angle.cos(), 2.0 * angle.sin(), 0.1 * angle.cos());
        let up = if k % 2 == 0 { 0.01 } else { -0.01 };
        let t = 0.05 * f64::from(k);
        writeln!(reference, "{t} {x} {y} {z} 0 0 0 1").unwrap();
        // Turned by half a radian about the vertical and shifted.
        let (c, s2) = (0.5_f64.cos(), 0.5_f64.sin());
        writeln!(estimate, "{t} {} {} {} 0 0 {sin} {cos}", c * x - s2 * y + 3.0, s2 * x + c * y - 1.0, z + up + 7.0)
            .unwrap();
    }
    let [a, b] = [("a.tum", reference), ("b.tum", estimate)].map(|(name, text)| {
        std::fs::write(s.0.join(name), text).unwrap();
        s.0.join(name)
    });
    let output = vio(&["eval", a.to_str().unwrap(), b.to_str().unwrap()], &s.0.join("out"));
    let table = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success() && table.contains("2000 pairs") && table.contains("100.0 %"), "{table}");
    let report: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(s.0.join("out/report.json")).unwrap()).unwrap();
    for key in ["ate_yaw_rmse_m", "ate_se3_rmse_m"] {
        let value = report[key].as_f64().unwrap();
        assert!((value - 0.01).abs() < 1e-4, "{key}: {value}");
    }
    assert!(report["ate_yaw_rotation_rmse_rad"].as_f64().unwrap() < 1e-3);
    assert!(!table.contains("scale"), "{table}");
    // The estimate at nine tenths of its size: said, and measured. Stamps that are off by 20 ms meet only if they may.
    let mut smaller = String::new();
    for line in std::fs::read_to_string(&b).unwrap().lines() {
        let v: Vec<f64> = line.split(' ').map(|v| v.parse().unwrap()).collect();
        let [x, y, z] = [v[1], v[2], v[3]].map(|v| 0.9 * v);
        writeln!(smaller, "{} {x} {y} {z} {} {} {} {}", v[0] + 0.02, v[4], v[5], v[6], v[7]).unwrap();
    }
    let c = s.0.join("c.tum");
    std::fs::write(&c, smaller).unwrap();
    let files = ["eval", a.to_str().unwrap(), c.to_str().unwrap()];
    let output = vio(&files, &s.0.join("out"));
    assert_eq!(output.status.code(), Some(1), "{}", String::from_utf8_lossy(&output.stdout));
    let output = vio(&[&files[..], &["--max-difference", "0.021", "--sim3", "--rpe", "4"]].concat(), &s.0.join("out"));
    let table = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(
        output.status.success() && table.contains("They differ by scale") && table.contains("1.111 times"),
        "{table}"
    );
    let report: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(s.0.join("out/report.json")).unwrap()).unwrap();
    assert!((report["scale"].as_f64().unwrap() - 1.0 / 0.9).abs() < 1e-3);
    assert_eq!(report["rpe_length_m"], serde_json::json!([4.0]));
    // A tenth of four metres of path along a circle, as chords.
    let chord = 2.0 * 2.0 * (0.5_f64 * 4.0 / 2.0).sin();
    assert!((report["rpe_translation_median_m"][0].as_f64().unwrap() - 0.1 * chord).abs() < 0.03, "{report}");
    let missing = vio(&["eval", a.to_str().unwrap(), "no/such.tum"], &s.0.join("out"));
    assert!(String::from_utf8_lossy(&missing.stderr).contains("no/such.tum") && missing.status.code() == Some(1));
}

/// The whole of what can be done with the real images that are there: a vehicle that hardly moves for 4.7 s.
#[test]
fn real_images_at_rest_do_not_drift() {
    let Some(source) = recorded("vio/euroc_V1_01_micro/mav0") else { return };
    let s = Scratch::new("micro");
    copy(&source, &s.0.join("mav0"));
    let unpack = |from: &str, to: &str| {
        let mut text = Vec::new();
        let packed = std::fs::File::open(source.join(from)).unwrap();
        MultiGzDecoder::new(packed).read_to_end(&mut text).unwrap();
        s.write(&format!("mav0/{to}"), text);
    };
    unpack("imu0/data.csv.gz", "imu0/data.csv");
    unpack("state_groundtruth_estimate0/V1_01_easy.txt.gz", "state_groundtruth_estimate0/data.csv");
    let recording = open_euroc(&s.0, &Overrides::default()).unwrap();
    recording.check(9.81).unwrap();
    let run = run(&recording, &RunSettings::default()).unwrap().run;
    assert_eq!((run.frames, run.skipped.len(), run.lost.len()), (95, 0, 0), "{:?} {:?}", run.skipped, run.lost);
    let evaluation = evaluate_run(&run, recording.truth.as_ref().unwrap()).unwrap().unwrap();
    let worst = evaluation.errors.iter().map(|e| e.position.norm()).fold(0.0, f64::max);
    eprintln!(
        "started after {:.2} s; drift at most {:.2} cm; NEES of position {:.2}, attitude {:.2}, velocity {:?}",
        run.initialization_time_s,
        100.0 * worst,
        evaluation.nees_position,
        evaluation.nees_attitude,
        evaluation.nees_velocity
    );
    assert!(run.initialization_time_s < 2.5, "{}", run.initialization_time_s);
    assert!(worst < 0.02, "{worst} m");
    // Consistent: 99.9 % of chi-square with 3 degrees of freedom is 16.3, and a mean cannot exceed that.
    for nees in [evaluation.nees_position, evaluation.nees_attitude, evaluation.nees_velocity.unwrap_or(0.0)] {
        assert!(nees < 16.3, "{nees}");
    }
}

/// A double-sphere lens, from Kalibr's file into the rendered recording and from there into the filter; and a rolling shutter.
#[test]
fn a_wide_lens_with_a_rolling_shutter_is_rendered_and_followed() {
    let s = Scratch::new("wide");
    s.write(
        "ds.yaml",
        "cam0:\n  camera_model: ds\n  intrinsics: [-0.172, 0.593, 120.0, 120.0, 187.5, 119.5]\n  distortion_model: none\n  \
         distortion_coeffs: []\n  resolution: [376, 240]\n  T_cam_imu:\n  - [0.0, 1.0, 0.0, 0.0]\n  - [-1.0, 0.0, 0.0, 0.0]\n  \
         - [0.0, 0.0, 1.0, 0.0]\n  - [0.0, 0.0, 0.0, 1.0]\n",
    );
    let (out, chain) = (s.path("sim"), s.path("ds.yaml"));
    let sim = vio(&["sim", "--cameras", &chain, "--readout", "0.02", "--seconds", "8"], Path::new(&out));
    assert!(sim.status.success(), "{}", String::from_utf8_lossy(&sim.stderr));
    let recording = open_euroc(Path::new(&out), &Overrides::default()).unwrap();
    assert_eq!(recording.camera.camera.distortion, vio_ekf::camera::Distortion::DoubleSphere([-0.172, 0.593]));
    assert!((recording.camera.row_time_s - 0.02 / 240.0).abs() < 1e-12);
    let follow = |recording| {
        let run = run(recording, &RunSettings { quiet: true, ..RunSettings::default() }).unwrap().run;
        evaluate_run(&run, recording.truth.as_ref().unwrap()).unwrap().unwrap().ate_se3
    };
    let known = follow(&recording);
    let mut ignored = recording.clone();
    ignored.camera.row_time_s = 0.0;
    let ignored = follow(&ignored);
    assert!(known < 0.03 && ignored > 1.5 * known, "{known} {ignored}");
}

/// Dead reckoning, with no image in the folder.
#[test]
fn inertial_samples_alone_are_carried_on_and_said_to_be() {
    let s = Scratch::new("inertial");
    simulate(&flight(6.0, false), &s.0).unwrap();
    std::fs::remove_dir_all(s.0.join("mav0/cam0")).unwrap();
    let folder = s.0.to_str().unwrap();
    let out = s.0.join("out");
    let ran = vio(&["inertial", "--euroc", folder, "--seconds", "4"], &out);
    let said = String::from_utf8_lossy(&ran.stderr).into_owned();
    assert!(ran.status.success() && said.contains("dead reckoning, inertial samples alone"), "{said}");
    let report: serde_json::Value = serde_json::from_slice(&std::fs::read(out.join("report.json")).unwrap()).unwrap();
    let figure = |name: &str| report[name].as_f64().unwrap();
    assert_eq!(report["mode"], "dead reckoning");
    assert!((figure("duration_s") - 4.0).abs() < 0.02, "{report}");
    // A start that is 5 cm/s and 0.1 m/s² off admits 1.5 m after four seconds; this one is exact.
    assert!(figure("position_error_end_m") < 0.1 && (0.5..2.0).contains(&figure("position_sigma_end_m")), "{report}");
    let poses = vio_ekf::format::tum::read(&std::fs::read_to_string(out.join("trajectory.tum")).unwrap()).unwrap();
    let states = std::fs::read_to_string(out.join("states.csv")).unwrap();
    assert_eq!((poses.len(), states.lines().count()), (800, 801));

    // A start of one's own; one without velocity, and one from another day.
    let row = std::fs::read_to_string(s.0.join("mav0/state_groundtruth_estimate0/data.csv")).unwrap();
    let row = row.lines().nth(300).unwrap().split(',').collect::<Vec<_>>();
    s.write("start.csv", row[..11].join(","));
    let start = |name: &str| {
        let ran = vio(&["inertial", "--euroc", folder, "--start", &s.path(name)], &out);
        (ran.status.code(), String::from_utf8_lossy(&ran.stderr).into_owned())
    };
    assert_eq!(start("start.csv").0, Some(0));
    s.write("pose.csv", row[..8].join(","));
    assert!(start("pose.csv").1.contains("has no velocity"));
    s.write("early.csv", format!("1{}", &row[..11].join(",")[2..]));
    let (code, said) = start("early.csv");
    assert!(code == Some(1) && said.contains("between the first and the last inertial sample"), "{said}");
}
