//! Folders and MCAP files hold the same recording, and broken ones are refused.

use std::path::PathBuf;

use paintcopter_examples::vio::{
    Images, Overrides, Recording, RunSettings, SimulationSettings, camera_frames, evaluate_run, open_euroc,
    open_euroc_stereo, open_mcap, open_mcap_stereo, run, simulate,
};
use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng as _, SeedableRng as _};
use vio_ekf::sim::SimulatedCamera;
use vio_ekf::{Camera, Distortion, Stamp};

use super::fixtures::{edit, flight, vio};
use crate::bags::{put, put_blob, recompress, ros_header};
use crate::scratch::Scratch;

fn follow(recording: &Recording, threads: usize) -> String {
    recording.check(9.81).unwrap();
    let run = run(recording, &RunSettings { threads, ..RunSettings::default() }).unwrap();
    assert!(run.skipped.len() <= 1 && run.lost.is_empty(), "{:?} {:?}", run.skipped, run.lost);
    let evaluation = evaluate_run(&run, recording.truth.as_ref().unwrap()).unwrap().unwrap();
    // Six seconds in the air, three metres: a hundredth of it is what the filter promises.
    assert!(evaluation.ate_yaw < 0.05 && evaluation.ate_se3 <= evaluation.ate_yaw + 1e-9, "{evaluation:?}");
    assert!(evaluation.coverage > 0.75, "{}", evaluation.coverage);
    assert!(evaluation.nees_position < 20.0 && evaluation.nees_attitude < 20.0);
    vio_ekf::tum::write(&run.trajectories().unwrap()[0])
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
    let found = run(&late, &RunSettings { threads: 1, quiet: true, ..RunSettings::default() }).unwrap();
    assert_eq!(found.calibration.time_offset_s, 0.03);
    close(&vio_ekf::tum::write(&found.trajectories().unwrap()[0]), &reference, 1e-6);

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
        let found = run(recording, &quiet).unwrap();
        (found.pairs, vio_ekf::tum::write(&found.trajectories().unwrap()[0]))
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
    assert!(mono.second.is_none() && mono.unused == ["/camera_right/image"], "{:?}", mono.unused);
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

/// Files with bytes changed, cut out, cut off and put in are read or refused, and nothing else: `MUTATIONS` is how many (500); a
/// million with `MUTATIONS=1000000 cargo test --release -p paintcopter-examples --all-features --test it mutated_recordings`.
#[test]
fn mutated_recordings_never_panic() {
    let count: u64 = std::env::var("MUTATIONS").map_or(500, |text| text.parse().unwrap());
    let s = Scratch::new("mutated");
    let tiny = |raw: bool| {
        let mut settings = flight(1.0, raw);
        let model = &mut settings.scenario.cameras[0];
        model.camera = Camera { width: 32, height: 24, fx: 20.0, fy: 20.0, cx: 15.5, cy: 11.5, ..model.camera };
        // Few of both, so that a mutation meets every kind of record.
        model.rate_hz = 4.0;
        settings.scenario.imus[0].rate_hz = 20.0;
        simulate(&settings, &s.0).unwrap();
        std::fs::read(s.0.join("recording.mcap")).unwrap()
    };
    let mut originals = vec![tiny(true), tiny(false)];
    for compression in ["lz4", "zstd"] {
        recompress(&s.0.join("recording.mcap"), &s.0.join("packed.mcap"), compression);
        originals.push(std::fs::read(s.0.join("packed.mcap")).unwrap());
    }
    let mut generator = SplitMix64::seed_from_u64(7);
    let mut random = move |below: usize| (generator.next_u64() % below.max(1) as u64) as usize;
    let file = s.0.join("mutated.mcap");
    let (mut read, mut images, mut slowest) = (0, 0, std::time::Duration::ZERO);
    for k in 0..count {
        let mut bytes = originals[k as usize % originals.len()].clone();
        for _ in 0..=random(3) {
            let at = random(bytes.len());
            match random(5) {
                0 => bytes[at] = random(256) as u8,
                1 => bytes[at] ^= 1 << random(8),
                // Lengths and counts: eight bytes of ones.
                2 => bytes.iter_mut().skip(at).take(8).for_each(|byte| *byte = 0xff),
                3 => drop(bytes.drain(at..(at + 1 + random(16)).min(bytes.len()))),
                _ => bytes.truncate(at.max(1)),
            }
            if bytes.is_empty() {
                break;
            }
        }
        std::fs::write(&file, &bytes).unwrap();
        let began = std::time::Instant::now();
        if let Ok(recording) = open_mcap(&file, &Overrides::default()) {
            read += 1;
            images += camera_frames(&recording).take(100).filter(|frame| frame.picture.is_ok()).count();
        }
        slowest = slowest.max(began.elapsed());
    }
    eprintln!("{read} of {count} are read, with {images} images; the slowest took {slowest:?}");
    assert!(read > 0 && read < count, "{read} of {count}");
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
    let t = camera.body_from_camera.inverse().to_homogeneous();
    let rows: Vec<String> = t.row_iter().map(|r| format!("  - [{}, {}, {}, {}]", r[0], r[1], r[2], r[3])).collect();
    let Distortion::RadTan([k1, k2, p1, p2]) = camera.distortion else { panic!("another camera") };
    let yaml = format!(
        "cam0:\n  T_cam_imu:\n{}\n  camera_model: pinhole\n  distortion_model: radtan\n  distortion_coeffs: [{k1}, {k2}, {p1}, \
         {p2}]\n  intrinsics: [{}, {}, {}, {}]\n  resolution: [{}, {}]\n  timeshift_cam_imu: 0.004\n",
        rows.join("\n"),
        camera.fx,
        camera.fy,
        camera.cx,
        camera.cy,
        camera.width,
        camera.height
    );
    s.write("cameras.yaml", yaml);
    let noise = folder.imu.noise;
    s.write(
        "imu.yaml",
        format!(
            "rostopic: /imu\nupdate_rate: 200.0\ngyroscope_noise_density: {}\ngyroscope_random_walk: {}\n\
             accelerometer_noise_density: {}\naccelerometer_random_walk: {}\n",
            noise.gyro_density, noise.gyro_walk, noise.accel_density, noise.accel_walk
        ),
    );
    let overrides = Overrides { cameras: Some(s.0.join("cameras.yaml")), imu: Some(s.0.join("imu.yaml")), truth: None };
    for compressed in [false, true] {
        let file = s.0.join("bag_0.mcap");
        let mut writer = mcap::WriteOptions::new()
            .compression(None)
            .profile("ros2")
            .create(std::io::BufWriter::new(std::fs::File::create(&file).unwrap()))
            .unwrap();
        let name = if compressed { "sensor_msgs/msg/CompressedImage" } else { "sensor_msgs/msg/Image" };
        let mut channel = |topic: &str, schema: &str| {
            let schema = writer.add_schema(schema, "ros2msg", b"").unwrap();
            writer.add_channel(schema, topic, "cdr", &std::collections::BTreeMap::new()).unwrap()
        };
        let channels = [channel("/imu/data", "sensor_msgs/msg/Imu"), channel("/camera/image", name)];
        let mut write = |channel: usize, stamp: Stamp, data: &[u8]| {
            let time = stamp.nanos() as u64;
            let header = mcap::records::MessageHeader {
                channel_id: channels[channel],
                sequence: 0,
                log_time: time,
                publish_time: time,
            };
            writer.write_to_known_channel(&header, data).unwrap();
        };
        for sample in &folder.samples {
            let mut bytes = ros_header(sample.stamp, "imu_link");
            let numbers = [&[0.0; 13][..], sample.gyro.as_slice(), &[0.0; 9], sample.accel.as_slice(), &[0.0; 9]];
            numbers.iter().flat_map(|part| part.iter()).for_each(|v| put(&mut bytes, v.to_le_bytes()));
            write(0, sample.stamp, &bytes);
        }
        for frame in &frames {
            let grey = frame.picture.as_ref().unwrap();
            let mut bytes = ros_header(frame.stamp, "camera");
            if compressed {
                let mut png = std::io::Cursor::new(Vec::new());
                let image =
                    image::GrayImage::from_raw(grey.width as u32, grey.height as u32, grey.data.clone()).unwrap();
                image.write_to(&mut png, image::ImageFormat::Png).unwrap();
                put_blob(&mut bytes, b"png\0");
                put_blob(&mut bytes, png.get_ref());
            } else {
                put(&mut bytes, (grey.height as u32).to_le_bytes());
                put(&mut bytes, (grey.width as u32).to_le_bytes());
                put_blob(&mut bytes, b"mono8\0");
                bytes.push(0);
                put(&mut bytes, (grey.width as u32).to_le_bytes());
                put_blob(&mut bytes, &grey.data);
            }
            write(1, frame.stamp, &bytes);
        }
        writer.finish().unwrap();
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
        run(recording, &RunSettings { threads, quiet: true, ..RunSettings::default() }).unwrap()
    };
    let recording = open_euroc_stereo(&s.0, &none).unwrap();
    let pair = follow(&recording, 1);
    assert_eq!((pair.frames, pair.pairs), (120, 120));
    assert_eq!(follow(&recording, 2).trajectories().unwrap(), pair.trajectories().unwrap(), "threads");
    let error =
        |run: &paintcopter_examples::vio::Run| evaluate_run(run, recording.truth.as_ref().unwrap()).unwrap().unwrap();
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
