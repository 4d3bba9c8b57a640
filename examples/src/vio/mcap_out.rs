//! Recordings as MCAP: images and calibration with Foxglove's schemas, inertial samples as ROS 2 has them, because Foxglove
//! has none of its own. Opens in Foxglove as it is.

use std::collections::BTreeMap;
use std::path::Path;

use foxglove::Encode;
use foxglove::messages::{
    self, CompressedImage, FrameTransform, Pose, PoseInFrame, Quaternion, RawImage, Timestamp,
    Vector3 as FoxgloveVector3,
};
use vio_ekf::camera::Distortion;
use vio_ekf::format::calibration::{CameraCalibration, ImuCalibration};
use vio_ekf::nalgebra::Isometry3;
use vio_ekf::{Imu, Stamp};

use super::error::VioError;
use super::grey_image::GreyImage;
use crate::mcap_messages::cdr;
use crate::whole_file::WholeFile;

/// Frames of the sensors.
pub(super) const IMU_FRAME: &str = "imu";
/// Frames of the cameras, and their topics: `/camera/image` and so on.
const CAMERA_FRAMES: [&str; 2] = ["camera", "camera_right"];
/// Name of the message that says what ROS has no message for.
pub(super) const NOISE_SCHEMA: &str = "paintcopter.ImuCalibration";
/// Definition of `sensor_msgs/msg/Imu` as ROS 2 recordings carry it.
const IMU_DEFINITION: &str = "\
std_msgs/Header header
geometry_msgs/Quaternion orientation
float64[9] orientation_covariance
geometry_msgs/Vector3 angular_velocity
float64[9] angular_velocity_covariance
geometry_msgs/Vector3 linear_acceleration
float64[9] linear_acceleration_covariance
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
================================================================================
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w
================================================================================
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
";

/// An image on its way into a file.
pub(super) enum Pixels<'a> {
    /// As it is.
    Raw(&'a GreyImage),
    /// Already a PNG.
    Png(&'a [u8]),
}

/// Writes a recording, message by message.
pub(super) struct McapWriter {
    writer: mcap::Writer<WholeFile>,
    path: String,
    sequence: u32,
    imu: u16,
    /// Of each camera.
    images: Vec<u16>,
    truth: u16,
    noise: [f64; 2],
}

impl McapWriter {
    /// Begins a file with what is known of the sensors: one camera or two. Images will all be raw, or all PNG.
    pub(super) fn create(
        path: &Path,
        began: Stamp,
        cameras: &[CameraCalibration],
        imu: &ImuCalibration,
        raw: bool,
    ) -> Result<Self, VioError> {
        let file = WholeFile::create(path).map_err(|error| VioError::unwritable(path, &error))?;
        let options = mcap::WriteOptions::new().compression(None).library("paintcopter");
        let failed = |error: mcap::McapError| VioError::unwritable(path, &error);
        let writer = options.create(file).map_err(failed)?;
        let white = [imu.noise.gyro_density, imu.noise.accel_density];
        let noise = white.map(|density| density * density * imu.rate_hz);
        let name = path.display().to_string();
        let mut out = Self { writer, path: name, sequence: 0, imu: 0, images: Vec::new(), truth: 0, noise };
        let mut describing = Vec::new();
        for (frame, _) in CAMERA_FRAMES.iter().zip(cameras) {
            let calibration = out.channel::<messages::CameraCalibration>(&format!("/{frame}/calibration"))?;
            let place = out.channel::<FrameTransform>(&format!("/{frame}/place"))?;
            describing.push((calibration, place));
            let topic = format!("/{frame}/image");
            let image = if raw { out.channel::<RawImage>(&topic)? } else { out.channel::<CompressedImage>(&topic)? };
            out.images.push(image);
        }
        out.truth = out.channel::<PoseInFrame>("/truth")?;
        let schema = out.writer.add_schema("sensor_msgs/msg/Imu", "ros2msg", IMU_DEFINITION.as_bytes());
        let schema = schema.map_err(failed)?;
        out.imu = out.writer.add_channel(schema, "/imu", "cdr", &BTreeMap::new()).map_err(failed)?;
        let schema = out.writer.add_schema(NOISE_SCHEMA, "jsonschema", br#"{"type":"object"}"#).map_err(failed)?;
        let densities = out.writer.add_channel(schema, "/imu/calibration", "json", &BTreeMap::new()).map_err(failed)?;

        for ((frame, camera), (calibration, place)) in CAMERA_FRAMES.iter().zip(cameras).zip(describing) {
            out.message(calibration, began, &calibration_message(began, frame, camera))?;
            out.message(place, began, &place_message(began, frame, &camera.camera.body_from_camera))?;
        }
        let text = serde_json::json!({
            "rate_hz": imu.rate_hz,
            "gyroscope_noise_density": imu.noise.gyro_density,
            "gyroscope_random_walk": imu.noise.gyro_walk,
            "accelerometer_noise_density": imu.noise.accel_density,
            "accelerometer_random_walk": imu.noise.accel_walk,
            "timeshift_cam_imu": cameras.first().map_or(0.0, |camera| camera.time_offset_s),
        });
        out.bytes(densities, began, text.to_string().as_bytes())?;
        Ok(out)
    }

    /// A sample.
    pub(super) fn imu(&mut self, sample: &Imu) -> Result<(), VioError> {
        let bytes = cdr::encode(&imu_message(sample, self.noise)).map_err(|error| self.failed(&error))?;
        self.bytes(self.imu, sample.stamp, &bytes)
    }

    /// An image of camera `which`, which must be one of those described; the stamp is the middle of the exposure.
    pub(super) fn image(&mut self, which: usize, stamp: Stamp, pixels: &Pixels) -> Result<(), VioError> {
        let (timestamp, frame_id) = (Some(timestamp(stamp)), CAMERA_FRAMES[which].to_string());
        let channel = self.images[which];
        match pixels {
            Pixels::Raw(grey) => {
                let (width, height) = (grey.width as u32, grey.height as u32);
                let (encoding, data) = ("mono8".into(), grey.data.clone().into());
                let message = RawImage { timestamp, frame_id, width, height, encoding, step: width, data };
                self.message(channel, stamp, &message)
            }
            Pixels::Png(bytes) => {
                let (data, format) = (bytes.to_vec().into(), "png".into());
                self.message(channel, stamp, &CompressedImage { timestamp, frame_id, data, format })
            }
        }
    }

    /// A true pose.
    pub(super) fn truth(&mut self, stamp: Stamp, world_from_body: &Isometry3<f64>) -> Result<(), VioError> {
        let pose = Pose { position: Some(vector(world_from_body)), orientation: Some(quaternion(world_from_body)) };
        let message = PoseInFrame { timestamp: Some(timestamp(stamp)), frame_id: "world".into(), pose: Some(pose) };
        self.message(self.truth, stamp, &message)
    }

    /// Ends the file.
    pub(super) fn finish(mut self) -> Result<(), VioError> {
        let unwritable = |why: &dyn std::fmt::Display| VioError::unwritable(Path::new(&self.path), why);
        self.writer.finish().map_err(|error| unwritable(&error))?;
        self.writer.into_inner().commit().map_err(|error| unwritable(&error))
    }

    fn channel<T: Encode>(&mut self, topic: &str) -> Result<u16, VioError> {
        let schema = match T::get_schema() {
            Some(s) => self.writer.add_schema(&s.name, &s.encoding, &s.data),
            None => Ok(0),
        };
        let channel = schema
            .and_then(|schema| self.writer.add_channel(schema, topic, &T::get_message_encoding(), &BTreeMap::new()));
        channel.map_err(|error| self.failed(&error))
    }

    fn message<T: Encode>(&mut self, channel: u16, stamp: Stamp, message: &T) -> Result<(), VioError> {
        let mut data = Vec::with_capacity(message.encoded_len().unwrap_or(256));
        message.encode(&mut data).map_err(|error| self.failed(&error))?;
        self.bytes(channel, stamp, &data)
    }

    fn bytes(&mut self, channel_id: u16, stamp: Stamp, data: &[u8]) -> Result<(), VioError> {
        let log_time = u64::try_from(stamp.nanos()).unwrap_or(0);
        self.sequence = self.sequence.wrapping_add(1);
        let header =
            mcap::records::MessageHeader { channel_id, sequence: self.sequence, log_time, publish_time: log_time };
        self.writer.write_to_known_channel(&header, data).map_err(|error| self.failed(&error))
    }

    fn failed(&self, why: &dyn std::fmt::Display) -> VioError {
        VioError::unwritable(Path::new(&self.path), why)
    }
}

fn timestamp(stamp: Stamp) -> Timestamp {
    let nanos = stamp.nanos().max(0);
    Timestamp::new((nanos / 1_000_000_000) as u32, (nanos % 1_000_000_000) as u32)
}

fn calibration_message(stamp: Stamp, frame: &str, calibration: &CameraCalibration) -> messages::CameraCalibration {
    let camera = &calibration.camera;
    let (fx, fy, cx, cy) = (camera.fx, camera.fy, camera.cx, camera.cy);
    let (model, d) = match camera.distortion {
        Distortion::None => ("plumb_bob", vec![0.0; 5]),
        Distortion::RadTan(k) => ("plumb_bob", k.into_iter().chain([0.0]).collect()),
        Distortion::Equidistant(k) => ("kannala_brandt", k.to_vec()),
        // Foxglove has no names for these: those of Kalibr.
        Distortion::Omni { xi, radtan } => ("omni", [&[xi][..], &radtan].concat()),
        Distortion::DoubleSphere(k) => ("ds", k.to_vec()),
        Distortion::Eucm(k) => ("eucm", k.to_vec()),
    };
    messages::CameraCalibration {
        timestamp: Some(timestamp(stamp)),
        frame_id: frame.into(),
        width: camera.width as u32,
        height: camera.height as u32,
        distortion_model: model.into(),
        d,
        k: vec![fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
        r: vec![1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        p: vec![fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
    }
}

fn place_message(stamp: Stamp, frame: &str, body_from_camera: &Isometry3<f64>) -> FrameTransform {
    FrameTransform {
        timestamp: Some(timestamp(stamp)),
        parent_frame_id: IMU_FRAME.into(),
        child_frame_id: frame.into(),
        translation: Some(vector(body_from_camera)),
        rotation: Some(quaternion(body_from_camera)),
    }
}

fn vector(pose: &Isometry3<f64>) -> FoxgloveVector3 {
    let t = pose.translation.vector;
    FoxgloveVector3 { x: t.x, y: t.y, z: t.z }
}

fn quaternion(pose: &Isometry3<f64>) -> Quaternion {
    let q = pose.rotation.quaternion();
    Quaternion { x: q.i, y: q.j, z: q.k, w: q.w }
}

/// The message of a sample. The covariances are those of one sample.
fn imu_message(sample: &Imu, [gyro, accel]: [f64; 2]) -> cdr::Imu {
    let diagonal = |variance: f64| [variance, 0.0, 0.0, 0.0, variance, 0.0, 0.0, 0.0, variance];
    cdr::Imu {
        header: cdr::Header::new(sample.stamp, IMU_FRAME),
        orientation: [0.0, 0.0, 0.0, 1.0],
        // The first covariance of -1 says that there is no orientation.
        orientation_covariance: [-1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        angular_velocity: sample.gyro.into(),
        angular_velocity_covariance: diagonal(gyro),
        linear_acceleration: sample.accel.into(),
        linear_acceleration_covariance: diagonal(accel),
    }
}
