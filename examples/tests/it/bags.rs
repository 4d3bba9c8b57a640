//! MCAP files of our own making: messages of ROS 2 by the rules of their encoding, and chunks compressed by other writers.

use std::path::Path;

use paintcopter::vio::{GreyImage, Recording};
use vio_ekf::camera::Distortion;
use vio_ekf::run::RecordedFrame;
use vio_ekf::{Imu, Stamp};

use crate::scratch::Scratch;

/// An MCAP file with the same messages in compressed chunks.
pub(crate) fn recompress(from: &Path, to: &Path, compression: &str) {
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

/// `std_msgs/Header` as the encoding's rules have it, little endian, after its four bytes; `put` then aligns what follows.
pub(crate) fn ros_header(stamp: Stamp, frame: &str) -> Vec<u8> {
    let mut bytes = vec![0, 1, 0, 0];
    bytes.extend(((stamp.nanos() / 1_000_000_000) as i32).to_le_bytes());
    bytes.extend(((stamp.nanos() % 1_000_000_000) as u32).to_le_bytes());
    put_blob(&mut bytes, &[frame.as_bytes(), &[0]].concat());
    bytes
}

pub(crate) fn put<const N: usize>(bytes: &mut Vec<u8>, number: [u8; N]) {
    bytes.resize(4 + (bytes.len() - 4).next_multiple_of(N), 0);
    bytes.extend(number);
}

pub(crate) fn put_blob(bytes: &mut Vec<u8>, blob: &[u8]) {
    put(bytes, (blob.len() as u32).to_le_bytes());
    bytes.extend(blob);
}

/// The calibration of a recording as Kalibr writes it, `cameras.yaml` and `imu.yaml`.
pub(crate) fn write_kalibr_files(s: &Scratch, folder: &Recording) {
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
}

/// Inertial samples and images as ROS 2 records them, raw or as PNG.
pub(crate) fn write_ros2_bag(file: &Path, samples: &[Imu], frames: &[RecordedFrame<GreyImage>], compressed: bool) {
    let mut writer = mcap::WriteOptions::new()
        .compression(None)
        .profile("ros2")
        .create(std::io::BufWriter::new(std::fs::File::create(file).unwrap()))
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
    for sample in samples {
        let mut bytes = ros_header(sample.stamp, "imu_link");
        let numbers = [&[0.0; 13][..], sample.gyro.as_slice(), &[0.0; 9], sample.accel.as_slice(), &[0.0; 9]];
        numbers.iter().flat_map(|part| part.iter()).for_each(|v| put(&mut bytes, v.to_le_bytes()));
        write(0, sample.stamp, &bytes);
    }
    for frame in frames {
        let grey = frame.picture.as_ref().unwrap();
        let mut bytes = ros_header(frame.stamp, "camera");
        if compressed {
            let mut png = std::io::Cursor::new(Vec::new());
            let image = image::GrayImage::from_raw(grey.width as u32, grey.height as u32, grey.data.clone()).unwrap();
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
}
