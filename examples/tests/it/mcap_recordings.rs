//! RGB-D recordings in one MCAP file, as ROS 2 and Foxglove write them: the same map as of the folder.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::process::Command;

use foxglove::Encode;
use foxglove::messages::{
    CameraCalibration, CompressedImage, FrameTransform, Quaternion, RawImage, Timestamp, Vector3 as FoxgloveVector3,
};
use image::{DynamicImage, ImageFormat, RgbImage};
use vio_ekf::Stamp;

use crate::bags::{put, put_blob, recompress, ros_header};
use crate::scratch::Scratch;
use crate::strange_recordings::{CAMERA, FRAMES, Ran, SIZE, pose, recording, scan};

/// A bag under way.
struct Bag {
    writer: mcap::Writer<BufWriter<File>>,
    channels: BTreeMap<String, u16>,
}

impl Bag {
    fn new(s: &Scratch, name: &str) -> Self {
        let file = BufWriter::new(File::create(s.0.join(name)).unwrap());
        Self { writer: mcap::WriteOptions::new().compression(None).create(file).unwrap(), channels: BTreeMap::new() }
    }

    fn write(&mut self, topic: &str, schema: &str, stamp: Stamp, data: &[u8]) {
        let encoding = if schema.starts_with("foxglove") { ["protobuf", "protobuf"] } else { ["ros2msg", "cdr"] };
        let channel_id = *self.channels.entry(topic.into()).or_insert_with(|| {
            let schema = self.writer.add_schema(schema, encoding[0], b"").unwrap();
            self.writer.add_channel(schema, topic, encoding[1], &BTreeMap::new()).unwrap()
        });
        let time = stamp.nanos() as u64;
        let header = mcap::records::MessageHeader { channel_id, sequence: 0, log_time: time, publish_time: time };
        self.writer.write_to_known_channel(&header, data).unwrap();
    }

    fn finish(mut self) {
        self.writer.finish().unwrap();
    }
}

fn stamp(k: usize) -> Stamp {
    Stamp::from_secs(10.0 + 0.1 * k as f64).unwrap()
}

fn depth_of(s: &Scratch, k: usize) -> Vec<u16> {
    image::open(s.0.join(format!("depth/{k}.png"))).unwrap().into_luma16().into_raw()
}

fn colour_of(s: &Scratch, k: usize) -> RgbImage {
    image::open(s.0.join(format!("rgb/{k}.png"))).unwrap().into_rgb8()
}

fn png(image: &DynamicImage) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    image.write_to(&mut bytes, ImageFormat::Png).unwrap();
    bytes.into_inner()
}

/// `sensor_msgs/Image`.
fn ros_image(stamp: Stamp, frame: &str, encoding: &str, step: u32, data: &[u8]) -> Vec<u8> {
    let mut bytes = ros_header(stamp, frame);
    put(&mut bytes, SIZE.1.to_le_bytes());
    put(&mut bytes, SIZE.0.to_le_bytes());
    put_blob(&mut bytes, &[encoding.as_bytes(), &[0]].concat());
    bytes.push(0);
    put(&mut bytes, step.to_le_bytes());
    put_blob(&mut bytes, data);
    bytes
}

fn ros_compressed(stamp: Stamp, frame: &str, format: &str, data: &[u8]) -> Vec<u8> {
    let mut bytes = ros_header(stamp, frame);
    put_blob(&mut bytes, &[format.as_bytes(), &[0]].concat());
    put_blob(&mut bytes, data);
    bytes
}

fn ros_camera(stamp: Stamp, frame: &str) -> Vec<u8> {
    let mut bytes = ros_header(stamp, frame);
    put(&mut bytes, SIZE.1.to_le_bytes());
    put(&mut bytes, SIZE.0.to_le_bytes());
    put_blob(&mut bytes, b"plumb_bob\0");
    put(&mut bytes, 5_u32.to_le_bytes());
    let [fx, fy, cx, cy] = CAMERA;
    let (k, r) = ([fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0], [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
    let p = [fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0];
    [&[0.0; 5][..], &k, &r, &p].concat().into_iter().for_each(|v| put(&mut bytes, v.to_le_bytes()));
    bytes.extend([0; 25]);
    bytes
}

/// `tf2_msgs/TFMessage` of one transform: the numbers of a pose.
fn ros_transform(stamp: Stamp, parent: &str, child: &str, numbers: [f64; 7]) -> Vec<u8> {
    let mut bytes = vec![0, 1, 0, 0];
    put(&mut bytes, 1_u32.to_le_bytes());
    put(&mut bytes, ((stamp.nanos() / 1_000_000_000) as i32).to_le_bytes());
    put(&mut bytes, ((stamp.nanos() % 1_000_000_000) as u32).to_le_bytes());
    put_blob(&mut bytes, &[parent.as_bytes(), &[0]].concat());
    put_blob(&mut bytes, &[child.as_bytes(), &[0]].concat());
    for v in numbers {
        put(&mut bytes, v.to_le_bytes());
    }
    bytes
}

fn numbers_of(k: usize) -> [f64; 7] {
    let (t, q) = (pose(k).translation.vector, pose(k).rotation.coords);
    [t.x, t.y, t.z, q.x, q.y, q.z, q.w]
}

/// `scan` on a file beside the folder.
fn scan_file(s: &Scratch, file: &str, options: &[&str]) -> Ran {
    let out = s.path("out");
    let mut command = Command::new(env!("CARGO_BIN_EXE_scan"));
    command.args(["--sequence", &s.path(file), "--out", &out, "--voxel", "0.02", "--threads", "1"]);
    let output = command.args(options).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!said.contains("panicked"), "{said}");
    let report = std::fs::read(s.0.join("out/report.json")).ok().and_then(|text| serde_json::from_slice(&text).ok());
    Ran { ok: output.status.success(), said, report: report.unwrap_or_default() }
}

/// A bag of ROS 2: depth as it is in memory or as a compressed PNG, colour 15 ms later.
fn ros_bag(s: &Scratch, name: &str, compressed: bool, with_camera: bool) {
    let mut bag = Bag::new(s, name);
    let (depth_frame, colour_frame) = ("camera_depth", "camera_colour");
    let still = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    for (parent, child) in [("base", depth_frame), ("base", colour_frame)] {
        bag.write("/tf_static", "tf2_msgs/msg/TFMessage", stamp(0), &ros_transform(stamp(0), parent, child, still));
    }
    for k in 0..FRAMES {
        let at = stamp(k);
        bag.write("/tf", "tf2_msgs/msg/TFMessage", at, &ros_transform(at, "map", "base", numbers_of(k)));
        if with_camera {
            bag.write("/depth/camera_info", "sensor_msgs/msg/CameraInfo", at, &ros_camera(at, depth_frame));
            bag.write("/rgb/camera_info", "sensor_msgs/msg/CameraInfo", at, &ros_camera(at, colour_frame));
        }
        let depth = depth_of(s, k);
        if compressed {
            let file = std::fs::read(s.0.join(format!("depth/{k}.png"))).unwrap();
            let data = [&[0; 12][..], &file].concat();
            let message = ros_compressed(at, depth_frame, "16UC1; compressedDepth png", &data);
            bag.write("/depth/image", "sensor_msgs/msg/CompressedImage", at, &message);
        } else {
            // Rows with four bytes of padding.
            let rows = depth
                .chunks(SIZE.0 as usize)
                .flat_map(|row| row.iter().flat_map(|d| d.to_le_bytes()).chain([7; 4]).collect::<Vec<u8>>());
            let message = ros_image(at, depth_frame, "16UC1", 2 * SIZE.0 + 4, &rows.collect::<Vec<u8>>());
            bag.write("/depth/image", "sensor_msgs/msg/Image", at, &message);
        }
        let later = Stamp::from_nanos(at.nanos() + 15_000_000);
        let rgb = colour_of(s, k);
        if compressed {
            let message = ros_compressed(later, colour_frame, "rgb8; png", &png(&DynamicImage::ImageRgb8(rgb)));
            bag.write("/rgb/image", "sensor_msgs/msg/CompressedImage", later, &message);
        } else {
            let bgr: Vec<u8> = rgb.pixels().flat_map(|p| [p.0[2], p.0[1], p.0[0]]).collect();
            let message = ros_image(later, colour_frame, "bgr8", 3 * SIZE.0, &bgr);
            bag.write("/rgb/image", "sensor_msgs/msg/Image", later, &message);
        }
    }
    bag.finish();
}

#[test]
fn a_bag_of_ros_2_gives_the_map_of_the_folder() {
    let s = recording("mcap-ros");
    let folder = scan(&s, &[]);
    assert!(folder.ok, "{}", folder.said);
    for (name, compressed) in [("raw.mcap", false), ("compressed.mcap", true)] {
        ros_bag(&s, name, compressed, true);
        let ran = scan_file(&s, name, &[]);
        assert!(ran.ok, "{}", ran.said);
        ran.says(&["MCAP layout, 12 frames", "fx 130", "160 x 120 pixels", "/depth/camera_info", "millimetres"]);
        assert_eq!(ran.report["map_hash"], folder.report["map_hash"], "{name}: {}", ran.said);
    }
    // Chunks of both kinds.
    for compression in ["lz4", "zstd"] {
        recompress(&s.0.join("raw.mcap"), &s.0.join("packed.mcap"), compression);
        let ran = scan_file(&s, "packed.mcap", &[]);
        assert_eq!(ran.report["map_hash"], folder.report["map_hash"], "{compression}: {}", ran.said);
    }
    // Without poses believed: found by the tracker, as from the folder.
    let tracked = scan(&s, &["--poses", "tracked"]);
    let ran = scan_file(&s, "raw.mcap", &["--poses", "tracked"]);
    assert_eq!(ran.report["map_hash"], tracked.report["map_hash"], "{}", ran.said);
}

#[test]
fn a_recording_of_foxglove_gives_the_map_of_the_folder() {
    let s = recording("mcap-foxglove");
    let folder = scan(&s, &[]);
    let mut bag = Bag::new(&s, "recording.mcap");
    for k in 0..FRAMES {
        let at = stamp(k);
        let time = Timestamp::new((at.nanos() / 1_000_000_000) as u32, (at.nanos() % 1_000_000_000) as u32);
        let mut write = |topic: &str, schema: &str, message: &dyn Fn(&mut Vec<u8>)| {
            let mut bytes = Vec::new();
            message(&mut bytes);
            bag.write(topic, schema, at, &bytes);
        };
        let [x, y, z, i, j, l, w] = numbers_of(k);
        let transform = FrameTransform {
            timestamp: Some(time),
            parent_frame_id: "map".into(),
            child_frame_id: "camera".into(),
            translation: Some(FoxgloveVector3 { x, y, z }),
            rotation: Some(Quaternion { x: i, y: j, z: l, w }),
        };
        write("/tf", "foxglove.FrameTransform", &|bytes| transform.encode(bytes).unwrap());
        let [fx, fy, cx, cy] = CAMERA;
        let camera = CameraCalibration {
            timestamp: Some(time),
            frame_id: "camera".into(),
            width: SIZE.0,
            height: SIZE.1,
            k: vec![fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
            ..CameraCalibration::default()
        };
        write("/calibration", "foxglove.CameraCalibration", &|bytes| camera.encode(bytes).unwrap());
        // Floating-point metres of whole millimetres.
        let metres = depth_of(&s, k)
            .iter()
            .flat_map(|&d| (f32::from(d) * (1.0 / 1000.0_f32)).to_le_bytes())
            .collect::<Vec<u8>>();
        let depth = RawImage {
            timestamp: Some(time),
            frame_id: "camera".into(),
            width: SIZE.0,
            height: SIZE.1,
            encoding: "32FC1".into(),
            step: 4 * SIZE.0,
            data: metres.into(),
        };
        write("/depth", "foxglove.RawImage", &|bytes| depth.encode(bytes).unwrap());
        let colour = CompressedImage {
            timestamp: Some(time),
            frame_id: "camera".into(),
            data: png(&DynamicImage::ImageRgb8(colour_of(&s, k))).into(),
            format: "png".into(),
        };
        write("/colour", "foxglove.CompressedImage", &|bytes| colour.encode(bytes).unwrap());
    }
    bag.finish();
    let ran = scan_file(&s, "recording.mcap", &[]);
    assert!(ran.ok, "{}", ran.said);
    assert_eq!(ran.report["map_hash"], folder.report["map_hash"], "{}", ran.said);
}

#[test]
fn what_a_recording_lacks_is_named() {
    let s = recording("mcap-lacks");
    ros_bag(&s, "no-camera.mcap", false, false);
    let ran = scan_file(&s, "no-camera.mcap", &[]);
    assert!(!ran.ok);
    ran.says(&["no-camera.mcap", "CameraInfo", "camera_depth", "/depth/image"]);
    Bag::new(&s, "empty.mcap").finish();
    let ran = scan_file(&s, "empty.mcap", &[]);
    assert!(!ran.ok);
    ran.says(&["no topic with depth images"]);
    s.write("text.mcap", "no recording");
    let ran = scan_file(&s, "text.mcap", &[]);
    assert!(!ran.ok);
    ran.says(&["text.mcap", "no sound MCAP file"]);
}
