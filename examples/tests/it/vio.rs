//! The odometry as people run it: folders and MCAP files in, trajectories and figures out, and what is wrong is named.

use std::fmt::Write as _;
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use flate2::read::MultiGzDecoder;
use paintcopter_examples::vio::{
    Flight, Images, Overrides, Recording, RunSettings, SimulationSettings, camera_frames, evaluate_run, open_euroc,
    open_euroc_stereo, open_mcap, open_mcap_stereo, run, simulate,
};
use vio_ekf::sim::{RoomSettings, Scenario, SimulatedCamera};
use vio_ekf::{Camera, Distortion, Stamp};

use crate::recorded::recorded;
use crate::scratch::Scratch;

/// A flight seen by a small camera, so that the tests stay short.
fn flight(seconds: f64, raw: bool) -> SimulationSettings {
    let euroc = Camera::euroc();
    let camera = Camera { width: 376, height: 240, fx: 229.3, fy: 228.6, cx: 183.4, cy: 123.9, ..euroc };
    let room = RoomSettings { texture_size: 512, ..RoomSettings::default() };
    let cameras = vec![SimulatedCamera { camera, ..SimulatedCamera::default() }];
    let scenario = Scenario { cameras, room, seed: 5, ..Scenario::default() };
    SimulationSettings { flight: Flight::Room, seconds, scenario, mcap: true, raw, threads: 2 }
}

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

/// An MCAP file with the same messages in compressed chunks.
fn recompress(from: &Path, to: &Path, compression: &str) {
    let bytes = std::fs::read(from).unwrap();
    let mut plain = mcap::WriteOptions::new().compression(None).create(std::io::Cursor::new(Vec::new())).unwrap();
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        plain.write(&message.unwrap()).unwrap();
    }
    plain.finish().unwrap();
    let plain = plain.into_inner().into_inner();
    // Its chunks one by one: opcode 6, a header of 8+8+8+4 bytes, the compression's name, the length of what follows.
    let (mut at, mut out) = (8, plain[..8].to_vec());
    while at + 9 <= plain.len() - 8 {
        let length = u64::from_le_bytes(plain[at + 1..at + 9].try_into().unwrap()) as usize;
        let (record, next) = (&plain[at + 9..at + 9 + length], at + 9 + length);
        match plain[at] {
            6 => {
                let content = &record[28 + 4 + 8..];
                let packed = match compression {
                    "lz4" => {
                        let mut encoder = lz4_flex::frame::FrameEncoder::new(Vec::new());
                        std::io::Write::write_all(&mut encoder, content).unwrap();
                        encoder.finish().unwrap()
                    }
                    _ => ruzstd::encoding::compress_to_vec(content, ruzstd::encoding::CompressionLevel::Fastest),
                };
                let mut chunk = record[..28].to_vec();
                chunk.extend((compression.len() as u32).to_le_bytes());
                chunk.extend(compression.as_bytes());
                chunk.extend((packed.len() as u64).to_le_bytes());
                chunk.extend(packed);
                out.push(6);
                out.extend((chunk.len() as u64).to_le_bytes());
                out.extend(chunk);
            }
            // The end of the data, and nothing after it: the indices would point elsewhere.
            15 => {
                out.extend([15, 4, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]);
                out.extend([2, 20, 0, 0, 0, 0, 0, 0, 0]);
                out.extend([0; 20]);
                break;
            }
            7 => {}
            _ => out.extend(&plain[at..next]),
        }
        at = next;
    }
    out.extend(&plain[..8]);
    std::fs::write(to, out).unwrap();
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
    let mut state = 7_u64;
    let mut random = move |below: usize| {
        // splitmix64.
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) % below.max(1) as u64) as usize
    };
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

/// `std_msgs/Header` as the encoding's rules have it, little endian, after its four bytes; `put` then aligns what follows.
fn ros_header(stamp: Stamp, frame: &str) -> Vec<u8> {
    let mut bytes = vec![0, 1, 0, 0];
    bytes.extend(((stamp.nanos() / 1_000_000_000) as i32).to_le_bytes());
    bytes.extend(((stamp.nanos() % 1_000_000_000) as u32).to_le_bytes());
    put_blob(&mut bytes, &[frame.as_bytes(), &[0]].concat());
    bytes
}

fn put<const N: usize>(bytes: &mut Vec<u8>, number: [u8; N]) {
    bytes.resize(4 + (bytes.len() - 4).next_multiple_of(N), 0);
    bytes.extend(number);
}

fn put_blob(bytes: &mut Vec<u8>, blob: &[u8]) {
    put(bytes, (blob.len() as u32).to_le_bytes());
    bytes.extend(blob);
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

/// Numbers of two texts, one by one.
fn close(a: &str, b: &str, tolerance: f64) {
    let numbers = |text: &str| -> Vec<f64> { text.split_whitespace().map(|word| word.parse().unwrap()).collect() };
    let (a, b) = (numbers(a), numbers(b));
    assert_eq!(a.len(), b.len());
    assert!(a.iter().zip(&b).all(|(x, y)| (x - y).abs() <= tolerance));
}

fn vio(arguments: &[&str], out: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_vio")).args(arguments).arg("--out").arg(out).output().unwrap()
}

fn copy(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        let target = to.join(entry.file_name());
        if entry.path().is_dir() { copy(&entry.path(), &target) } else { drop(std::fs::copy(entry.path(), target)) }
    }
}

/// Changes a text file below the folder.
fn edit(folder: &Path, name: &str, change: impl Fn(&str) -> String) {
    let path = folder.join("mav0").join(name);
    std::fs::write(&path, change(&std::fs::read_to_string(&path).unwrap())).unwrap();
}

/// Changes the numbered columns of every data line of the inertial samples.
fn columns(text: &str, change: impl Fn(&mut Vec<String>)) -> String {
    let line = |line: &str| {
        if line.starts_with('#') {
            return line.to_string();
        }
        let mut fields: Vec<String> = line.split(',').map(str::to_string).collect();
        change(&mut fields);
        fields.join(",")
    };
    text.lines().map(|l| line(l) + "\n").collect()
}

fn images(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder.join("mav0/cam0/data")).unwrap();
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files
}

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
fn run_folder(folder: &Path, more: &[&str]) -> (Option<i32>, String, Option<serde_json::Value>) {
    let out = folder.join("out");
    let output = vio(&[&["--euroc", folder.to_str().unwrap()], more].concat(), &out);
    let report = std::fs::read_to_string(out.join("report.json")).ok();
    let report = report.map(|text| serde_json::from_str(&text).unwrap());
    (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned(), report)
}

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
    let found = run(&recording, &RunSettings { threads: 1, quiet: true, ..RunSettings::default() }).unwrap();
    let last =
        found.segments.iter().flat_map(|segment| &segment.odometry).map(|odometry| odometry.stamp).max().unwrap();
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
    let run = run(&recording, &RunSettings::default()).unwrap();
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
