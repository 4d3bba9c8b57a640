//! Recordings as MCAP: images as Foxglove or ROS 2 has them, inertial samples as ROS 2 has them.

mod fields;
mod pixels;

use std::path::{Path, PathBuf};

use foxglove::Decode;
use foxglove::messages::{self, FrameTransform, FrameTransforms, PoseInFrame};
use mcap::Message;
use vio_ekf::camera::Distortion;
use vio_ekf::format::calibration;
use vio_ekf::format::calibration::{CameraCalibration, ImuCalibration};
use vio_ekf::nalgebra::Isometry3;
use vio_ekf::{Camera, Imu, ImuNoise, Stamp, Trajectory};

use super::error::{VioError, read_text};
use super::euroc_folder::{Overrides, read_truth};
use super::grey_image::GreyImage;
use super::mcap_out::NOISE_SCHEMA;
use super::recording::{GroundTruth, Images, Recording, SecondCamera};
use crate::mcap_messages::fields::{isometry, stamp};
use crate::mcap_messages::images::image_header;
use crate::mcap_messages::{MessagesFault, messages_of, schema_of};
use fields::{imu, noise};
use pixels::image;

/// Opens an MCAP file: one pass for everything but the images, which are read later, one by one.
///
/// The first topic with images and the first with inertial samples are taken. The camera's calibration comes from
/// `foxglove.CameraCalibration` and a `foxglove.FrameTransform` from the inertial sensor's frame to the camera's, the noise from
/// our own message; files of Kalibr take their place.
///
/// # Errors
/// [`VioError`] names what the file lacks, or what cannot be read.
pub fn open_mcap(path: &Path, overrides: &Overrides) -> Result<Recording, VioError> {
    open(path, overrides, false)
}

/// As [`open_mcap`], with the second topic of images as a second camera. A chain of Kalibr must hold both, in this order.
///
/// # Errors
/// [`VioError`] names what the file lacks, or what cannot be read.
pub fn open_mcap_stereo(path: &Path, overrides: &Overrides) -> Result<Recording, VioError> {
    open(path, overrides, true)
}

fn open(path: &Path, overrides: &Overrides, stereo: bool) -> Result<Recording, VioError> {
    let mut found = Found::default();
    for message in messages_of(path).map_err(|why| fault(path, &why))? {
        found.take(&message.map_err(|why| fault(path, &why))?).map_err(|why| VioError::malformed(path, &why))?;
    }
    let lacks = |what: &str| VioError::malformed(path, &what);
    if found.images.is_empty() {
        return Err(lacks(
            "no topic with images: expected foxglove.RawImage, foxglove.CompressedImage, sensor_msgs/msg/Image or \
               sensor_msgs/msg/CompressedImage",
        ));
    }
    if stereo && found.images.len() < 2 {
        return Err(lacks(&format!("one topic with images only, `{}`: --stereo needs two", found.images[0].topic)));
    }
    if found.samples.is_empty() {
        return Err(lacks("no topic with inertial samples: expected sensor_msgs/msg/Imu in CDR"));
    }
    let (cameras, imu) = found.calibrations(path, overrides, if stereo { 2 } else { 1 })?;
    let unused = found.images.iter().skip(cameras.len()).map(|images| images.topic.clone()).collect();
    let mut images = found.images.into_iter().map(|ImageTopic { topic, stamps, .. }| Images::Mcap {
        path: path.to_path_buf(),
        topic,
        stamps,
    });
    let truth = match &overrides.truth {
        Some(path) => Some(read_truth(path)?),
        None => (!found.truth.is_empty())
            .then_some(GroundTruth { trajectory: found.truth, velocities_in_world: Vec::new() }),
    };
    let name = path.display().to_string();
    let first = images.next().ok_or_else(|| lacks("no images"))?;
    let second =
        cameras.get(1).zip(images.next()).map(|(second, images)| SecondCamera { camera: second.camera, images });
    Ok(Recording {
        name,
        camera: cameras[0],
        imu,
        samples: found.samples,
        images: first,
        second,
        truth,
        unused,
        mask: None,
    })
}

/// The images of a topic in the order of the file, with their stamps.
pub(super) fn read_images(
    path: PathBuf,
    topic: String,
) -> Box<dyn Iterator<Item = (Stamp, Result<GreyImage, String>)> + Send> {
    let failed = |why: String| (Stamp::default(), Err(why));
    let messages = match messages_of(&path) {
        Ok(messages) => messages,
        Err(why) => return Box::new(std::iter::once(failed(fault(&path, &why).to_string()))),
    };
    Box::new(messages.filter_map(move |message| match message {
        Ok(message) if message.channel.topic == topic => Some(match image(&message) {
            Some((stamp, picture)) => (stamp, picture.map_err(|why| format!("image of {stamp} s: {why}"))),
            None => failed("a message on the images' topic that is no image".into()),
        }),
        Ok(_) => None,
        Err(why) => Some(failed(fault(&path, &why).to_string())),
    }))
}

fn fault(path: &Path, fault: &MessagesFault) -> VioError {
    match fault {
        MessagesFault::Unreadable(why) => VioError::unreadable(path, why),
        MessagesFault::Malformed(why) => VioError::malformed(path, why),
    }
}

/// Images of one camera.
struct ImageTopic {
    topic: String,
    frame: String,
    stamps: Vec<Stamp>,
}

/// Everything but the images.
#[derive(Default)]
struct Found {
    samples: Vec<Imu>,
    imu_topic: Option<String>,
    imu_frame: String,
    /// In the order in which they appear.
    images: Vec<ImageTopic>,
    /// One for each frame.
    cameras: Vec<messages::CameraCalibration>,
    frames: Vec<FrameTransform>,
    noise: Option<(ImuNoise, f64, f64)>,
    truth: Trajectory,
}

impl Found {
    fn take(&mut self, message: &Message) -> Result<(), String> {
        let (topic, data) = (&message.channel.topic, message.data.as_ref());
        let name = schema_of(message);
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
            | "sensor_msgs/msg/CompressedImage" => {
                let Some((stamp, frame)) = image_header(name, data) else { return Ok(()) };
                match self.images.iter_mut().find(|images| images.topic == *topic) {
                    Some(images) => images.stamps.push(stamp),
                    None => self.images.push(ImageTopic { topic: topic.clone(), frame, stamps: vec![stamp] }),
                }
            }
            "foxglove.CameraCalibration" => {
                let camera = messages::CameraCalibration::decode(data).map_err(|_| bad())?;
                self.cameras.retain(|other| other.frame_id != camera.frame_id);
                self.cameras.push(camera);
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
        count: usize,
    ) -> Result<(Vec<CameraCalibration>, ImuCalibration), VioError> {
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
            let chain = calibration::read_kalibr_cameras(&read_text(file)?);
            let mut chain = chain.map_err(|error| VioError::malformed(file, &error))?;
            if chain.len() < count {
                return Err(VioError::malformed(file, &"holds one camera only"));
            }
            chain.truncate(count);
            return Ok((chain, imu));
        }
        let read = |images: &ImageTopic| {
            let camera = self.camera(images).map_err(|why| {
                VioError::malformed(path, &format!("{why}: give Kalibr's camera chain with --cameras"))
            })?;
            camera.check()?;
            // Through the same text as the calibration of a folder, so that the same camera is the same to the last bit.
            let written = CameraCalibration { camera, rate_hz: None, time_offset_s: 0.0, row_time_s: 0.0 };
            let read = calibration::read_asl_camera(&calibration::write_asl_camera(&written))?;
            Ok(CameraCalibration { time_offset_s, ..read })
        };
        let cameras = self.images.iter().take(count).map(read).collect::<Result<_, VioError>>()?;
        Ok((cameras, imu))
    }

    fn camera(&self, images: &ImageTopic) -> Result<Camera, String> {
        let of_frame = self.cameras.iter().find(|camera| camera.frame_id == images.frame);
        // A camera that is alone needs no name.
        let message = of_frame.or(self.cameras.first().filter(|_| self.cameras.len() == 1 && self.images.len() == 1));
        let message = message.ok_or_else(|| {
            format!(
                "holds no foxglove.CameraCalibration of the frame `{}`, that of topic {}",
                images.frame, images.topic
            )
        })?;
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
        let two = |d: &[f64]| <[f64; 2]>::try_from(d).map_err(|_| "its model has two distortion parameters");
        let distortion = match message.distortion_model.as_str() {
            "" => Distortion::None,
            "plumb_bob" if message.d.iter().skip(4).all(|&k3| k3 == 0.0) => Distortion::RadTan(four(&message.d)?),
            "kannala_brandt" | "equidistant" => Distortion::Equidistant(four(&message.d)?),
            // Not names of Foxglove: those of Kalibr, with the parameters in its order.
            "omni" => {
                let (xi, radtan) = message.d.split_first().ok_or("too few distortion parameters")?;
                Distortion::Omni { xi: *xi, radtan: four(radtan)? }
            }
            "ds" => Distortion::DoubleSphere(two(&message.d)?),
            "eucm" => Distortion::Eucm(two(&message.d)?),
            model => return Err(format!("its distortion model `{model}` is not known (or has a third radial term)")),
        };
        let (width, height) = (message.width as usize, message.height as usize);
        Ok(Camera { width, height, fx: k[0], fy: k[4], cx: k[2], cy: k[5], distortion, body_from_camera })
    }
}
