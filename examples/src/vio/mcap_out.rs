//! Recordings as MCAP with the messages of ROS 2, which Foxglove opens as they are.

use std::path::Path;

use vio_ekf::camera::Distortion;
use vio_ekf::format::calibration::{CameraCalibration, ImuCalibration};
use vio_ekf::nalgebra::Isometry3;
use vio_ekf::{Imu, Stamp};

use super::error::VioError;
use super::grey_image::GreyImage;
use crate::mcap_messages::cdr::{self, CompressedImage, Header, Image, Pose, PoseStamped, TransformStamped};
use crate::mcap_messages::ros2::{CameraInfo, Ros2Writer, RosMessage, Text, Transforms};
use crate::recording::Origin;

/// Frames of the sensors.
pub(super) const IMU_FRAME: &str = "imu";
/// Frames of the cameras, and their topics: `/camera/image` and so on.
const CAMERA_FRAMES: [&str; 2] = ["camera", "camera_right"];
/// Topic of what ROS has no message for: the noise of the inertial sensor and the offset of the camera's clock, as JSON.
pub(super) const NOISE_TOPIC: &str = "/imu/calibration";

/// An image on its way into a file.
pub(super) enum Pixels<'a> {
    /// As it is.
    Raw(&'a GreyImage),
    /// Already a PNG.
    Png(&'a [u8]),
}

/// Writes a recording, message by message.
pub(super) struct McapWriter {
    writer: Ros2Writer,
    path: String,
    noise: [f64; 2],
}

impl McapWriter {
    /// Begins a file with what is known of the sensors: one camera or two.
    pub(super) fn create(
        path: &Path,
        began: Stamp,
        cameras: &[CameraCalibration],
        imu: &ImuCalibration,
        seed: u64,
    ) -> Result<Self, VioError> {
        let writer = Ros2Writer::create(path).map_err(|error| VioError::unwritable(path, &error))?;
        let white = [imu.noise.gyro_density, imu.noise.accel_density];
        let noise = white.map(|density| density * density * imu.rate_hz);
        let origin = Origin { seed: Some(seed), attachments: Vec::new() };
        let mut out = Self { writer, path: path.display().to_string(), noise };
        let described = out.writer.describe(&origin.metadata());
        described.map_err(|error| VioError::unwritable(path, &error))?;
        for (frame, camera) in CAMERA_FRAMES.iter().zip(cameras) {
            out.message(&format!("/{frame}/camera_info"), began, &camera_info(began, frame, camera))?;
        }
        let place = |(frame, camera): (&&str, &CameraCalibration)| {
            let Pose { position, orientation } = pose(&camera.camera.body_from_camera);
            let (header, child_frame_id) = (Header::new(began, IMU_FRAME), (*frame).into());
            TransformStamped { header, child_frame_id, translation: position, rotation: orientation }
        };
        let places = CAMERA_FRAMES.iter().zip(cameras).map(place).collect();
        out.message("/tf_static", began, &Transforms(places))?;
        let text = serde_json::json!({
            "rate_hz": imu.rate_hz,
            "gyroscope_noise_density": imu.noise.gyro_density,
            "gyroscope_random_walk": imu.noise.gyro_walk,
            "accelerometer_noise_density": imu.noise.accel_density,
            "accelerometer_random_walk": imu.noise.accel_walk,
            "timeshift_cam_imu": cameras.first().map_or(0.0, |camera| camera.time_offset_s),
        });
        out.message(NOISE_TOPIC, began, &Text(text.to_string()))?;
        Ok(out)
    }

    /// A sample.
    pub(super) fn imu(&mut self, sample: &Imu) -> Result<(), VioError> {
        self.message("/imu", sample.stamp, &imu_message(sample, self.noise))
    }

    /// An image of camera `which`, which must be one of those described; the stamp is the middle of the exposure.
    pub(super) fn image(&mut self, which: usize, stamp: Stamp, pixels: &Pixels) -> Result<(), VioError> {
        let frame = CAMERA_FRAMES[which];
        let (topic, header) = (format!("/{frame}/image"), Header::new(stamp, frame));
        match pixels {
            Pixels::Raw(grey) => {
                let (width, height) = (grey.width as u32, grey.height as u32);
                let (encoding, data) = ("mono8".into(), grey.data.as_slice());
                let image = Image { header, height, width, encoding, is_bigendian: 0, step: width, data };
                self.message(&topic, stamp, &image)
            }
            Pixels::Png(bytes) => {
                let image = CompressedImage { header, format: "png".into(), data: bytes };
                self.message(&topic, stamp, &image)
            }
        }
    }

    /// A true pose.
    pub(super) fn truth(&mut self, stamp: Stamp, world_from_body: &Isometry3<f64>) -> Result<(), VioError> {
        let message = PoseStamped { header: Header::new(stamp, "world"), pose: pose(world_from_body) };
        self.message("/truth", stamp, &message)
    }

    /// Ends the file.
    pub(super) fn finish(self) -> Result<(), VioError> {
        let Self { writer, path, .. } = self;
        writer.finish().map_err(|error| VioError::unwritable(Path::new(&path), &error))
    }

    fn message<M: RosMessage>(&mut self, topic: &str, stamp: Stamp, message: &M) -> Result<(), VioError> {
        let time = u64::try_from(stamp.nanos()).unwrap_or(0);
        let written = self.writer.write(topic, time, message);
        written.map_err(|error| VioError::unwritable(Path::new(&self.path), &error))
    }
}

fn camera_info(stamp: Stamp, frame: &str, calibration: &CameraCalibration) -> CameraInfo {
    let camera = &calibration.camera;
    let (fx, fy, cx, cy) = (camera.fx, camera.fy, camera.cx, camera.cy);
    let (model, d) = match camera.distortion {
        Distortion::None => ("plumb_bob", vec![0.0; 5]),
        Distortion::RadTan(k) => ("plumb_bob", k.into_iter().chain([0.0]).collect()),
        Distortion::Equidistant(k) => ("equidistant", k.to_vec()),
        // ROS has no names for these: those of Kalibr.
        Distortion::Omni { xi, radtan } => ("omni", [&[xi][..], &radtan].concat()),
        Distortion::DoubleSphere(k) => ("ds", k.to_vec()),
        Distortion::Eucm(k) => ("eucm", k.to_vec()),
    };
    let first = cdr::CameraInfo {
        header: Header::new(stamp, frame),
        height: camera.height as u32,
        width: camera.width as u32,
        distortion_model: model.into(),
        d,
        k: [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
    };
    CameraInfo {
        first,
        r: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        p: [fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
        ..CameraInfo::default()
    }
}

fn pose(parent_from_child: &Isometry3<f64>) -> Pose {
    let q = parent_from_child.rotation.quaternion();
    Pose { position: parent_from_child.translation.vector.into(), orientation: [q.i, q.j, q.k, q.w] }
}

/// The message of a sample. The covariances are those of one sample.
fn imu_message(sample: &Imu, [gyro, accel]: [f64; 2]) -> cdr::Imu {
    let diagonal = |variance: f64| [variance, 0.0, 0.0, 0.0, variance, 0.0, 0.0, 0.0, variance];
    cdr::Imu {
        header: Header::new(sample.stamp, IMU_FRAME),
        orientation: [0.0, 0.0, 0.0, 1.0],
        // The first covariance of -1 says that there is no orientation.
        orientation_covariance: [-1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        angular_velocity: sample.gyro.into(),
        angular_velocity_covariance: diagonal(gyro),
        linear_acceleration: sample.accel.into(),
        linear_acceleration_covariance: diagonal(accel),
    }
}
