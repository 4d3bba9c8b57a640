//! Recordings as MCAP: images as Foxglove or ROS 2 has them, inertial samples as ROS 2 has them.

mod fields;
mod frames;
mod pixels;
mod topics;

use std::path::{Path, PathBuf};

use foxglove::Decode;
use foxglove::messages::{self, FrameTransform, FrameTransforms, PoseInFrame};
use mcap::Message;
use vio_ekf::camera::Distortion;
use vio_ekf::format::calibration;
use vio_ekf::format::calibration::{CameraCalibration, ImuCalibration};
use vio_ekf::nalgebra::Isometry3;
use vio_ekf::run::GroundTruth;
use vio_ekf::{Camera, Imu, ImuNoise, Stamp, Trajectory};

use super::error::{VioError, read_text};
use super::euroc_folder::{Overrides, read_truth};
use super::grey_image::GreyImage;
use super::mcap_out::NOISE_TOPIC;
use super::recording::{Images, Recording, SecondCamera};
use crate::mcap_messages::cdr;
use crate::mcap_messages::fields::{isometry, isometry_of, stamp};
use crate::mcap_messages::images::{self, image_header};
use crate::mcap_messages::{MessagesFault, messages_of, schema_of};
use fields::noise;
use frames::StillFrames;
use pixels::image;
use topics::{ImageTopic, ImuTopic, choose_imu, order_images};

/// Opens an MCAP file: one pass for everything but the images, which are read later, one by one.
///
/// The topics that are named are taken; otherwise the first with images that are no depth and fit the calibration, and the first
/// with rates and forces. The camera's calibration comes from `foxglove.CameraCalibration` or `sensor_msgs/msg/CameraInfo` and the
/// transforms between the frames of both sensors, the noise from our own message; files of Kalibr take their place.
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
    let lacks = |what: String| VioError::malformed(path, &what);
    let Found { imus, images, cameras, frames, noise, truth: poses } = found;
    if images.is_empty() {
        return Err(lacks(
            "no topic with images: expected foxglove.RawImage, foxglove.CompressedImage, sensor_msgs/msg/Image or \
             sensor_msgs/msg/CompressedImage"
                .into(),
        ));
    }
    if stereo && images.len() < 2 {
        return Err(lacks(format!("one topic with images only, `{}`: --stereo needs two", images[0].topic)));
    }
    let (sensor, mut unused) = choose_imu(imus, overrides.imu_topic.as_deref()).map_err(lacks)?;
    let chain = overrides.cameras.as_deref().map(|file| (file, kalibr_chain(file)));
    let chain = chain.map(|(file, chain)| chain.map(|chain| (file, chain))).transpose()?;
    let size =
        chain.as_ref().and_then(|(_, chain)| chain.first()).map(|first| (first.camera.width, first.camera.height));
    let images = order_images(images, &overrides.camera_topics, size).map_err(lacks)?;
    let known = Known { cameras, frames, noise, imu_frame: &sensor.frame };
    let count = if stereo { 2 } else { 1 };
    let (imu, time_offset_s, assumed) = known.imu(&sensor.samples, overrides)?;
    let cameras = match chain {
        Some((file, chain)) if chain.len() < count => return Err(VioError::malformed(file, &"holds one camera only")),
        Some((_, mut chain)) => {
            chain.truncate(count);
            chain
        }
        None => known.cameras(path, &images[..count], time_offset_s)?,
    };
    let others = images.iter().skip(count).map(ImageTopic::describe);
    unused.splice(0..0, others);
    let mut images = images.into_iter().map(|ImageTopic { topic, stamps, .. }| Images::Mcap {
        path: path.to_path_buf(),
        topic,
        stamps,
    });
    let truth = match &overrides.truth {
        Some(path) => Some(read_truth(path)?),
        None => (!poses.is_empty()).then_some(GroundTruth { trajectory: poses, velocities_in_world: Vec::new() }),
    };
    let name = path.display().to_string();
    let first = images.next().ok_or_else(|| lacks("no images".into()))?;
    let second =
        cameras.get(1).zip(images.next()).map(|(second, images)| SecondCamera { camera: second.camera, images });
    Ok(Recording {
        name,
        camera: cameras[0],
        imu,
        samples: sensor.samples,
        images: first,
        second,
        truth,
        unused,
        assumed,
        mask: None,
    })
}

fn kalibr_chain(file: &Path) -> Result<Vec<CameraCalibration>, VioError> {
    calibration::read_kalibr_cameras(&read_text(file)?).map_err(|error| VioError::malformed(file, &error))
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
        MessagesFault::Malformed(why) | MessagesFault::CutOff(why) => VioError::malformed(path, why),
    }
}

/// Everything but the images.
#[derive(Default)]
struct Found {
    /// In the order in which they appear, as the next.
    imus: Vec<ImuTopic>,
    images: Vec<ImageTopic>,
    /// One for each frame.
    cameras: Vec<messages::CameraCalibration>,
    frames: StillFrames,
    noise: Option<(ImuNoise, f64, f64)>,
    truth: Trajectory,
}

impl Found {
    fn take(&mut self, message: &Message) -> Result<(), String> {
        let (topic, data) = (&message.channel.topic, message.data.as_ref());
        let name = schema_of(message);
        let bad = || format!("topic {topic}: a {name} that cannot be decoded");
        match name {
            "sensor_msgs/msg/Imu" => {
                let index = self.imus.iter().position(|imu| imu.topic == *topic);
                let index = index.unwrap_or_else(|| {
                    self.imus.push(ImuTopic::new(topic));
                    self.imus.len() - 1
                });
                self.imus[index].take(data);
            }
            _ if images::SCHEMAS.contains(&name) => {
                match self.images.iter_mut().find(|images| images.topic == *topic) {
                    Some(images) => images.stamps.extend(image_header(name, data).map(|header| header.0)),
                    None => self.images.extend(ImageTopic::new(message)),
                }
            }
            "foxglove.CameraCalibration" => {
                self.add_camera(messages::CameraCalibration::decode(data).map_err(|_| bad())?);
            }
            "sensor_msgs/msg/CameraInfo" => {
                let info: cdr::CameraInfo = cdr::decode(data).ok_or_else(bad)?;
                self.add_camera(messages::CameraCalibration {
                    frame_id: info.header.frame_id,
                    width: info.width,
                    height: info.height,
                    distortion_model: info.distortion_model,
                    d: info.d,
                    k: info.k.to_vec(),
                    ..messages::CameraCalibration::default()
                });
            }
            "foxglove.FrameTransform" => self.add_frame(&FrameTransform::decode(data).map_err(|_| bad())?),
            "foxglove.FrameTransforms" => {
                let all = FrameTransforms::decode(data).map_err(|_| bad())?.transforms;
                for frame in &all {
                    self.add_frame(frame);
                }
            }
            "tf2_msgs/msg/TFMessage" => {
                let transforms: Vec<cdr::TransformStamped> = cdr::decode(data).ok_or_else(bad)?;
                for frame in transforms {
                    if let Some(pose) = isometry_of(frame.translation, frame.rotation) {
                        self.frames.add(&frame.header.frame_id, &frame.child_frame_id, pose);
                    }
                }
            }
            "foxglove.PoseInFrame" if topic == "/truth" => {
                let message = PoseInFrame::decode(data).map_err(|_| bad())?;
                let pose = message.pose.and_then(|pose| isometry(pose.position, pose.orientation));
                let (Some(stamp), Some(pose)) = (message.timestamp.map(stamp), pose) else { return Err(bad()) };
                self.truth.push(stamp, pose).map_err(|error| format!("topic {topic}: {error}"))?;
            }
            "geometry_msgs/msg/PoseStamped" if topic == "/truth" => {
                let cdr::PoseStamped { header, pose } = cdr::decode(data).ok_or_else(bad)?;
                let pose = isometry_of(pose.position, pose.orientation).ok_or_else(bad)?;
                self.truth.push(header.stamp(), pose).map_err(|error| format!("topic {topic}: {error}"))?;
            }
            "std_msgs/msg/String" if topic == NOISE_TOPIC => {
                let text: String = cdr::decode(data).ok_or_else(bad)?;
                self.noise = Some(noise(&text).ok_or_else(bad)?);
            }
            _ => {}
        }
        Ok(())
    }

    /// The latest of a frame counts.
    fn add_camera(&mut self, camera: messages::CameraCalibration) {
        self.cameras.retain(|other| other.frame_id != camera.frame_id);
        self.cameras.push(camera);
    }

    fn add_frame(&mut self, frame: &FrameTransform) {
        if let Some(pose) = frame.translation.and_then(|moved| isometry(Some(moved), frame.rotation)) {
            self.frames.add(&frame.parent_frame_id, &frame.child_frame_id, pose);
        }
    }
}

/// What the file says of the sensors.
struct Known<'a> {
    cameras: Vec<messages::CameraCalibration>,
    frames: StillFrames,
    noise: Option<(ImuNoise, f64, f64)>,
    imu_frame: &'a str,
}

impl Known<'_> {
    /// Noise and rate of the inertial sensor, the offset of the camera's clock, and what of it is assumed.
    fn imu(&self, samples: &[Imu], overrides: &Overrides) -> Result<(ImuCalibration, f64, Vec<String>), VioError> {
        let mut assumed = Vec::new();
        let (noise, rate_hz, time_offset_s) = match (&overrides.imu, self.noise) {
            (Some(file), _) => {
                let imu = calibration::read_kalibr_imu(&read_text(file)?);
                let imu = imu.map_err(|error| VioError::malformed(file, &error))?;
                (imu.noise, imu.rate_hz, 0.0)
            }
            (None, Some(known)) => known,
            (None, None) => {
                assumed.push(
                    "the noise of the inertial sensor is not known: that of an ADIS16448 is assumed (Kalibr's file with --imu \
                     tells it)"
                        .into(),
                );
                (ImuNoise::default(), usual_rate(samples), 0.0)
            }
        };
        Ok((ImuCalibration { noise, rate_hz, body_from_imu: Isometry3::identity() }, time_offset_s, assumed))
    }

    fn cameras(
        &self,
        path: &Path,
        images: &[ImageTopic],
        time_offset_s: f64,
    ) -> Result<Vec<CameraCalibration>, VioError> {
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
        images.iter().map(read).collect()
    }

    fn camera(&self, images: &ImageTopic) -> Result<Camera, String> {
        let of_frame = self.cameras.iter().find(|camera| camera.frame_id == images.frame);
        // A camera that is alone needs no name.
        let message = of_frame.or(self.cameras.first().filter(|_| self.cameras.len() == 1));
        let message = message.ok_or_else(|| {
            format!(
                "holds no foxglove.CameraCalibration or sensor_msgs/msg/CameraInfo of the frame `{}`, that of topic {}",
                images.frame, images.topic
            )
        })?;
        let body_from_camera = self.frames.pose(&message.frame_id, self.imu_frame).ok_or_else(|| {
            format!(
                "holds no transform between `{}` and `{}` (foxglove.FrameTransform, tf2_msgs/msg/TFMessage)",
                self.imu_frame, message.frame_id
            )
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

/// One over the median time between samples, Hz.
fn usual_rate(samples: &[Imu]) -> f64 {
    let mut times: Vec<f64> = samples.windows(2).map(|pair| pair[1].stamp.secs_since(pair[0].stamp)).collect();
    times.sort_unstable_by(f64::total_cmp);
    times.get(times.len() / 2).filter(|time| **time > 0.0).map_or(200.0, |time| time.recip())
}

#[cfg(test)]
mod tests {
    use vio_ekf::nalgebra::Vector3;

    use super::*;

    #[test]
    fn the_usual_rate_is_that_of_most_samples() {
        let sample = |millis: i64| Imu {
            stamp: Stamp::from_nanos(1_000_000 * millis),
            gyro: Vector3::zeros(),
            accel: Vector3::zeros(),
        };
        let samples: Vec<Imu> = [0, 4, 8, 12, 112, 116].map(sample).to_vec();
        assert!((usual_rate(&samples) - 250.0).abs() < 1e-9);
        assert_eq!([usual_rate(&samples[..1]), usual_rate(&[])], [200.0; 2]);
    }
}
