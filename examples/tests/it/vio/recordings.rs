//! Folders and MCAP files hold the same recording, and broken ones are refused.

use std::path::PathBuf;

use paintcopter::vio::{
    Images, Overrides, Recording, RunSettings, SimulationSettings, camera_frames, open_euroc, open_euroc_stereo,
    open_mcap, open_mcap_stereo, run, simulate,
};
use vio_ekf::run::evaluate_run;
use vio_ekf::sim::SimulatedCamera;
use vio_ekf::{Camera, Stamp};

use super::fixtures::{edit, flight, vio};
use crate::bags::{recompress, write_kalibr_files, write_ros2_bag};
use crate::scratch::Scratch;

fn follow(recording: &Recording, threads: usize) -> String {
    recording.check(9.81).unwrap();
    let run = run(recording, &RunSettings { threads, ..RunSettings::default() }).unwrap().run;
    assert!(run.skipped.len() <= 1 && run.lost.is_empty(), "{:?} {:?}", run.skipped, run.lost);
    let evaluation = evaluate_run(&run, recording.truth.as_ref().unwrap()).unwrap().unwrap();
    // Six seconds in the air, three metres: a hundredth of it is what the filter promises.
    assert!(evaluation.ate_yaw < 0.05 && evaluation.ate_se3 <= evaluation.ate_yaw + 1e-9, "{evaluation:?}");
    assert!(evaluation.coverage > 0.75, "{}", evaluation.coverage);
    assert!(evaluation.nees_position < 20.0 && evaluation.nees_attitude < 20.0);
    vio_ekf::format::tum::write(&run.trajectories().unwrap()[0])
}

/// Numbers of two texts, one by one.
fn close(a: &str, b: &str, tolerance: f64) {
    let numbers = |text: &str| -> Vec<f64> { text.split_whitespace().map(|word| word.parse().unwrap()).collect() };
    let (a, b) = (numbers(a), numbers(b));
    assert_eq!(a.len(), b.len());
    assert!(a.iter().zip(&b).all(|(x, y)| (x - y).abs() <= tolerance));
}

#[test]
fn folders_and_mcap_files_give_the_same_trajectory() {
    let s = Scratch::new("same");
    let simulated = simulate(&flight(8.0, false), &s.0).unwrap();
    assert_eq!(simulated.frames, 160);
    let none = Overrides::default();
    let folder = open_euroc(&s.0, &none).unwrap();
    let reference = follow(&folder, 1);
    assert_eq!(follow(&folder, 2), reference, "threads");
    let file = s.0.join("recording.mcap");
    let recorded = open_mcap(&file, &none).unwrap();
    assert_eq!(recorded.samples, folder.samples);
    assert_eq!(recorded.images.count(), 160);
    assert_eq!(recorded.camera.camera, folder.camera.camera);
    // A camera whose clock is 30 ms behind the inertial sensor's, with a calibration that says so, saw the same.
    let mut late = folder.clone();
    late.camera.time_offset_s = 0.03;
    let Images::Files(files) = &mut late.images else { panic!("a folder has files") };
    for (stamp, _) in files.iter_mut() {
        *stamp = Stamp::from_nanos(stamp.nanos() - 30_000_000);
    }
    let found = run(&late, &RunSettings { threads: 1, quiet: true, ..RunSettings::default() }).unwrap().run;
    // It is estimated from a millisecond.
    assert!((found.calibration.time_offset_s - 0.03).abs() < 1e-3, "{}", found.calibration.time_offset_s);
    close(&vio_ekf::format::tum::write(&found.trajectories().unwrap()[0]), &reference, 1e-6);

    let through_mcap = follow(&recorded, 1);
    assert_eq!(through_mcap, reference, "folder and MCAP");
    // Raw pixels are the same pixels, and more threads render the same.
    let raw = Scratch::new("raw");
    simulate(&SimulationSettings { threads: 1, ..flight(8.0, true) }, &raw.0).unwrap();
    assert_eq!(follow(&open_mcap(&raw.0.join("recording.mcap"), &none).unwrap(), 1), through_mcap);
}

/// Two cameras in a folder and in a file, plain and compressed in both ways, are the same to the last bit.
#[test]
fn a_second_camera_in_mcap_is_that_of_the_folder() {
    let s = Scratch::new("mcap-stereo");
    let mut settings = flight(4.0, true);
    let left = settings.scenario.cameras[0].clone();
    let place = Camera::euroc_right().body_from_camera;
    let right = Camera { body_from_camera: place, ..left.camera };
    settings.scenario.cameras.push(SimulatedCamera { camera: right, ..left });
    simulate(&settings, &s.0).unwrap();
    let none = Overrides::default();
    let quiet = RunSettings { threads: 1, quiet: true, ..RunSettings::default() };
    let text = |recording: &Recording| {
        let found = run(recording, &quiet).unwrap().run;
        (found.pairs, vio_ekf::format::tum::write(&found.trajectories().unwrap()[0]))
    };
    let folder = text(&open_euroc_stereo(&s.0, &none).unwrap());
    assert_eq!(folder.0, 80);
    let plain = s.0.join("recording.mcap");
    let recording = open_mcap_stereo(&plain, &none).unwrap();
    assert_eq!(
        recording.second.as_ref().unwrap().camera,
        open_euroc_stereo(&s.0, &none).unwrap().second.unwrap().camera
    );
    assert_eq!(text(&recording), folder);
    let mono = open_mcap(&plain, &none).unwrap();
    assert!(mono.second.is_none() && mono.unused == ["/camera_right/image (80 images, 376x240)"], "{:?}", mono.unused);
    for compression in ["lz4", "zstd"] {
        let packed = s.0.join(format!("{compression}.mcap"));
        recompress(&plain, &packed, compression);
        assert!(std::fs::metadata(&packed).unwrap().len() < std::fs::metadata(&plain).unwrap().len());
        assert_eq!(text(&open_mcap_stereo(&packed, &none).unwrap()), folder, "{compression}");
    }
    // One camera is no pair.
    let alone = Scratch::new("mcap-mono");
    simulate(&flight(1.0, true), &alone.0).unwrap();
    let error = open_mcap_stereo(&alone.0.join("recording.mcap"), &none).unwrap_err().to_string();
    assert!(error.contains("--stereo needs two") && error.contains("/camera/image"), "{error}");
}

/// A record that claims to be longer than any file asks for no memory.
#[test]
fn lengths_that_cannot_be_are_refused() {
    let s = Scratch::new("lengths");
    simulate(&flight(1.0, true), &s.0).unwrap();
    let sound = std::fs::read(s.0.join("recording.mcap")).unwrap();
    let file = s.0.join("broken.mcap");
    let mut at = 8;
    let mut tried = 0;
    while at + 9 <= sound.len() - 8 && tried < 60 {
        let length = u64::from_le_bytes(sound[at + 1..at + 9].try_into().unwrap());
        for claimed in [u64::MAX, 6_000_000_000_000_000_000, 1 << 40, length + (1 << 31)] {
            let mut bytes = sound.clone();
            bytes[at + 1..at + 9].copy_from_slice(&claimed.to_le_bytes());
            std::fs::write(&file, bytes).unwrap();
            let error = open_mcap(&file, &Overrides::default()).unwrap_err().to_string();
            assert!(error.contains("broken.mcap"), "{error}");
            tried += 1;
        }
        at += 9 + length as usize;
    }
    assert!(tried > 10, "{tried}");
}

/// A bag as ROS 2 records it: raw and compressed images, inertial samples, calibration in Kalibr's files.
#[test]
fn a_bag_of_ros_2_is_read_like_the_folder() {
    let s = Scratch::new("bag");
    let simulated = simulate(&SimulationSettings { mcap: false, ..flight(2.0, false) }, &s.0).unwrap();
    let folder = open_euroc(&s.0, &Overrides::default()).unwrap();
    let frames: Vec<_> = camera_frames(&folder).collect();
    assert_eq!(frames.len(), simulated.frames);
    let camera = folder.camera.camera;
    write_kalibr_files(&s, &folder);
    let overrides =
        Overrides { cameras: Some(s.0.join("cameras.yaml")), imu: Some(s.0.join("imu.yaml")), ..Overrides::default() };
    for compressed in [false, true] {
        let file = s.0.join("bag_0.mcap");
        write_ros2_bag(&file, &folder.samples, &frames, compressed);
        let bag = open_mcap(&file, &overrides).unwrap();
        assert_eq!((&bag.samples, bag.images.count()), (&folder.samples, frames.len()));
        assert_eq!(bag.camera.time_offset_s, 0.004);
        let (a, b) = (bag.camera.camera, camera);
        assert_eq!((a.distortion, a.fx, a.cy, a.width), (b.distortion, b.fx, b.cy, b.width));
        assert!((a.body_from_camera.inverse() * b.body_from_camera).translation.vector.norm() < 1e-12);
        for (found, expected) in camera_frames(&bag).zip(&frames) {
            assert_eq!((found.stamp, found.picture.unwrap()), (expected.stamp, expected.picture.clone().unwrap()));
        }
    }
}

#[test]
fn a_second_camera_is_used_where_it_has_images() {
    let s = Scratch::new("pair");
    let mut settings = flight(6.0, false);
    settings.mcap = false;
    let left = settings.scenario.cameras[0].clone();
    let place = Camera::euroc().body_from_camera.inverse() * Camera::euroc_right().body_from_camera;
    let camera = Camera { body_from_camera: left.camera.body_from_camera * place, ..left.camera };
    settings.scenario.cameras.push(SimulatedCamera { camera, ..left });
    simulate(&settings, &s.0).unwrap();
    let none = Overrides::default();
    let follow = |recording: &Recording, threads: usize| {
        recording.check(9.81).unwrap();
        run(recording, &RunSettings { threads, quiet: true, ..RunSettings::default() }).unwrap().run
    };
    let recording = open_euroc_stereo(&s.0, &none).unwrap();
    let pair = follow(&recording, 1);
    assert_eq!((pair.frames, pair.pairs), (120, 120));
    assert_eq!(follow(&recording, 2).trajectories().unwrap(), pair.trajectories().unwrap(), "threads");
    let error = |run: &vio_ekf::run::Run| evaluate_run(run, recording.truth.as_ref().unwrap()).unwrap().unwrap();
    assert!(error(&pair).ate_yaw < 0.03, "{}", error(&pair).ate_yaw);
    // With one camera the trajectory is another one.
    let alone = follow(&open_euroc(&s.0, &none).unwrap(), 1);
    assert!(alone.pairs == 0 && alone.trajectories().unwrap() != pair.trajectories().unwrap());

    // One image is lost, one is no image, one is small: the first camera goes on alone.
    let second = |k: usize| {
        let mut files: Vec<PathBuf> =
            std::fs::read_dir(s.0.join("mav0/cam1/data")).unwrap().map(|e| e.unwrap().path()).collect();
        files.sort();
        files[k].clone()
    };
    let (broken, small) = (second(50), second(60));
    std::fs::write(&broken, "PNG").unwrap();
    image::GrayImage::new(16, 16).save(&small).unwrap();
    edit(&s.0, "cam1/data.csv", |text| {
        text.lines().enumerate().filter(|(k, _)| *k != 80).map(|(_, line)| line.to_string() + "\n").collect()
    });
    let holes = follow(&open_euroc_stereo(&s.0, &none).unwrap(), 1);
    assert_eq!((holes.frames, holes.pairs, holes.skipped.len()), (120, 117, 2), "{:?}", holes.skipped);
    assert!(error(&holes).ate_yaw < 0.03);

    // Not a single one, no calibration, no folder.
    let refused = |words: &[&str]| {
        let output = vio(&["--stereo", "--euroc", s.0.to_str().unwrap()], &s.0.join("out"));
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(1) && words.iter().all(|word| text.contains(word)), "{text}");
    };
    edit(&s.0, "cam1/data.csv", |text| {
        let later = |line: &str| if line.starts_with('#') { line.to_string() } else { line.replacen("17", "18", 1) };
        text.lines().map(|line| later(line) + "\n").collect()
    });
    refused(&["no image of the second camera", "stamps"]);
    std::fs::remove_file(s.0.join("mav0/cam1/sensor.yaml")).unwrap();
    refused(&["cam1/sensor.yaml"]);
    std::fs::remove_dir_all(s.0.join("mav0/cam1")).unwrap();
    refused(&["no second camera", "mav0/cam1"]);
}
