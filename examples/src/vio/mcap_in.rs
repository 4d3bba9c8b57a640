//! Recordings as MCAP: images as Foxglove or ROS 2 has them, inertial samples as ROS 2 has them.

mod fields;
mod pixels;

use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use foxglove::Decode;
use foxglove::messages::{self, FrameTransform, FrameTransforms, PoseInFrame};
use mcap::Message;
use vio_ekf::calibration::{self, CameraCalibration, ImuCalibration};
use vio_ekf::nalgebra::Isometry3;
use vio_ekf::{Camera, Distortion, Imu, ImuNoise, Stamp, Trajectory};

use super::error::{VioError, read_text};
use super::euroc_folder::{Overrides, read_truth};
use super::grey_image::GreyImage;
use super::mcap_out::NOISE_SCHEMA;
use super::recording::{GroundTruth, Images, Recording};
use fields::{imu, isometry, noise, stamp};
use pixels::{image, image_stamp};

/// Opens an MCAP file: one pass for everything but the images, which are read later, one by one.
///
/// The first topic with images and the first with inertial samples are taken. The camera's calibration comes from
/// `foxglove.CameraCalibration` and a `foxglove.FrameTransform` from the inertial sensor's frame to the camera's, the noise from
/// our own message; files of Kalibr take their place.
///
/// # Errors
/// [`VioError`] names what the file lacks, or what cannot be read.
pub fn open_mcap(path: &Path, overrides: &Overrides) -> Result<Recording, VioError> {
    let mut found = Found::default();
    for message in messages_of(path)? {
        found.take(&message.map_err(|error| broken(path, &error))?).map_err(|why| VioError::malformed(path, &why))?;
    }
    let lacks = |what: &str| VioError::malformed(path, &what);
    let topic = found.image_topic.clone().ok_or_else(|| {
        lacks(
            "no topic with images: expected foxglove.RawImage, foxglove.CompressedImage, sensor_msgs/msg/Image or \
               sensor_msgs/msg/CompressedImage",
        )
    })?;
    if found.samples.is_empty() {
        return Err(lacks("no topic with inertial samples: expected sensor_msgs/msg/Imu in CDR"));
    }
    let (camera, imu) = found.calibrations(path, overrides)?;
    let truth = match &overrides.truth {
        Some(path) => Some(read_truth(path)?),
        None => (!found.truth.is_empty())
            .then_some(GroundTruth { trajectory: found.truth, velocities_in_world: Vec::new() }),
    };
    let images = Images::Mcap { path: path.to_path_buf(), topic, stamps: found.image_stamps };
    let name = path.display().to_string();
    Ok(Recording { name, camera, imu, samples: found.samples, images, second: None, truth })
}

/// The images of a topic in the order of the file, with their stamps.
pub(super) fn read_images(
    path: PathBuf,
    topic: String,
) -> Box<dyn Iterator<Item = (Stamp, Result<GreyImage, String>)> + Send> {
    let failed = |why: String| (Stamp::default(), Err(why));
    let messages = match messages_of(&path) {
        Ok(messages) => messages,
        Err(error) => return Box::new(std::iter::once(failed(error.to_string()))),
    };
    Box::new(messages.filter_map(move |message| match message {
        Ok(message) if message.channel.topic == topic => Some(match image(&message) {
            Some((stamp, picture)) => (stamp, picture.map_err(|why| format!("image of {stamp} s: {why}"))),
            None => failed("a message on the images' topic that is no image".into()),
        }),
        Ok(_) => None,
        Err(error) => Some(failed(broken(&path, &error).to_string())),
    }))
}

/// Streams a file's messages; memory does not grow with the file.
fn messages_of(
    path: &Path,
) -> Result<impl Iterator<Item = mcap::McapResult<Message<'static>>> + Send + use<>, VioError> {
    let file = File::open(path).map_err(|error| VioError::unreadable(path, &error))?;
    Ok(mcap::io::MessageReader::new(BufReader::new(file)))
}

fn broken(path: &Path, error: &mcap::McapError) -> VioError {
    match error {
        mcap::McapError::UnsupportedCompression(name) => VioError::malformed(
            path,
            &format!(
                "its chunks are compressed with {name}, which is not read here: rewrite it with `mcap compress --compression none`"
            ),
        ),
        error => VioError::malformed(path, &format!("no sound MCAP file ({error}): `mcap recover` may help")),
    }
}

/// Everything but the images.
#[derive(Default)]
struct Found {
    samples: Vec<Imu>,
    imu_topic: Option<String>,
    imu_frame: String,
    image_topic: Option<String>,
    image_stamps: Vec<Stamp>,
    camera: Option<messages::CameraCalibration>,
    frames: Vec<FrameTransform>,
    noise: Option<(ImuNoise, f64, f64)>,
    truth: Trajectory,
}

impl Found {
    fn take(&mut self, message: &Message) -> Result<(), String> {
        let (topic, data) = (&message.channel.topic, message.data.as_ref());
        let name = message.channel.schema.as_ref().map_or("", |schema| schema.name.as_str());
        let bad = || format!("topic {topic}: a {name} that cannot be decoded");
        match name {
            "sensor_msgs/msg/Imu" if self.imu_topic.get_or_insert_with(|| topic.clone()) == topic => {
                let (sample, frame) = imu(data).ok_or_else(bad)?;
                // Drivers repeat samples; a stamp that goes back is another matter.
                if self.samples.last().is_none_or(|last| last.stamp != sample.stamp) {
                    self.samples.push(sample);
                }
                self.imu_frame = frame;
            }
            "foxglove.RawImage"
            | "foxglove.CompressedImage"
            | "sensor_msgs/msg/Image"
            | "sensor_msgs/msg/CompressedImage"
                if self.image_topic.get_or_insert_with(|| topic.clone()) == topic =>
            {
                self.image_stamps.extend(image_stamp(name, data));
            }
            "foxglove.CameraCalibration" => {
                self.camera = Some(messages::CameraCalibration::decode(data).map_err(|_| bad())?);
            }
            "foxglove.FrameTransform" => self.frames.push(FrameTransform::decode(data).map_err(|_| bad())?),
            "foxglove.FrameTransforms" if self.frames.len() < 1000 => {
                self.frames.extend(FrameTransforms::decode(data).map_err(|_| bad())?.transforms);
            }
            "foxglove.PoseInFrame" if topic == "/truth" => {
                let message = PoseInFrame::decode(data).map_err(|_| bad())?;
                let pose = message.pose.and_then(|pose| isometry(pose.position, pose.orientation));
                let (Some(stamp), Some(pose)) = (message.timestamp.map(stamp), pose) else { return Err(bad()) };
                self.truth.push(stamp, pose).map_err(|error| format!("topic {topic}: {error}"))?;
            }
            NOISE_SCHEMA => self.noise = Some(noise(data).ok_or_else(bad)?),
            _ => {}
        }
        Ok(())
    }

    fn calibrations(
        &self,
        path: &Path,
        overrides: &Overrides,
    ) -> Result<(CameraCalibration, ImuCalibration), VioError> {
        let (noise, rate_hz, time_offset_s) = match &overrides.imu {
            Some(file) => {
                let imu = calibration::read_kalibr_imu(&read_text(file)?);
                let imu = imu.map_err(|error| VioError::malformed(file, &error))?;
                (imu.noise, imu.rate_hz, 0.0)
            }
            None => self.noise.ok_or_else(|| {
                VioError::malformed(
                    path,
                    &"says nothing about the noise of its inertial sensor: give Kalibr's file with --imu",
                )
            })?,
        };
        let imu = ImuCalibration { noise, rate_hz, body_from_imu: Isometry3::identity() };
        if let Some(file) = &overrides.cameras {
            let cameras = calibration::read_kalibr_cameras(&read_text(file)?);
            return Ok((cameras.map_err(|error| VioError::malformed(file, &error))?[0], imu));
        }
        let camera = self
            .camera()
            .map_err(|why| VioError::malformed(path, &format!("{why}: give Kalibr's camera chain with --cameras")))?;
        camera.check()?;
        Ok((CameraCalibration { camera, rate_hz: None, time_offset_s }, imu))
    }

    fn camera(&self) -> Result<Camera, String> {
        let message = self.camera.as_ref().ok_or("holds no foxglove.CameraCalibration")?;
        let place = |frame: &&FrameTransform| {
            frame.child_frame_id == message.frame_id && frame.parent_frame_id == self.imu_frame
        };
        let body_from_camera = self.frames.iter().find(place).and_then(|f| {
            let t = f.translation?;
            isometry(Some(t), f.rotation)
        });
        let body_from_camera = body_from_camera.ok_or_else(|| {
            format!("holds no foxglove.FrameTransform from `{}` to `{}`", self.imu_frame, message.frame_id)
        })?;
        let k: [f64; 9] = message.k.as_slice().try_into().map_err(|_| "its camera matrix has not nine numbers")?;
        let four =
            |d: &[f64]| d.get(..4).and_then(|d| <[f64; 4]>::try_from(d).ok()).ok_or("too few distortion parameters");
        let distortion = match message.distortion_model.as_str() {
            "" => Distortion::None,
            "plumb_bob" if message.d.iter().skip(4).all(|&k3| k3 == 0.0) => Distortion::RadTan(four(&message.d)?),
            "kannala_brandt" | "equidistant" => Distortion::Equidistant(four(&message.d)?),
            model => return Err(format!("its distortion model `{model}` is not known (or has a third radial term)")),
        };
        let (width, height) = (message.width as usize, message.height as usize);
        Ok(Camera { width, height, fx: k[0], fy: k[4], cx: k[2], cy: k[5], distortion, body_from_camera })
    }
}
