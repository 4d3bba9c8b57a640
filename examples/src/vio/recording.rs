use std::path::PathBuf;

use vio_ekf::calibration::{CameraCalibration, ImuCalibration};
use vio_ekf::{Imu, SampleFindings, Stamp, Trajectory, check_samples, nalgebra::Vector3};

use super::{GreyImage, SecondCamera, VioError, mcap_in};

/// A camera and an inertial sensor, recorded; the body is the inertial sensor.
#[derive(Debug, Clone)]
pub struct Recording {
    /// Folder or file it came from.
    pub name: String,
    /// The camera on the body.
    pub camera: CameraCalibration,
    /// The inertial sensor. Its `body_from_imu` is the identity.
    pub imu: ImuCalibration,
    /// Inertial samples, by rising stamps.
    pub samples: Vec<Imu>,
    /// The images, not yet read.
    pub images: Images,
    /// A second camera beside the first.
    pub second: Option<SecondCamera>,
    /// What is known of the true motion.
    pub truth: Option<GroundTruth>,
}

/// The true motion of the body, as far as it was recorded.
#[derive(Debug, Clone)]
pub struct GroundTruth {
    /// Poses.
    pub trajectory: Trajectory,
    /// Velocity in world axes, m/s, one per pose; empty if it was not recorded.
    pub velocities_in_world: Vec<Vector3<f64>>,
}

/// Where the images are.
#[derive(Debug, Clone)]
pub enum Images {
    /// One file each, by rising stamps.
    Files(Vec<(Stamp, PathBuf)>),
    /// On a topic of an MCAP file.
    Mcap {
        /// The file.
        path: PathBuf,
        /// The topic.
        topic: String,
        /// Times of the images, in the order of the file.
        stamps: Vec<Stamp>,
    },
}

/// An image that was due.
pub struct CameraFrame {
    /// Middle of the exposure by the camera's clock.
    pub stamp: Stamp,
    /// The image, or why there is none.
    pub picture: Result<GreyImage, String>,
    /// The image that a second camera took together with it, if there is one.
    pub second: Option<Result<GreyImage, String>>,
}

impl Images {
    /// How many there should be.
    pub fn count(&self) -> usize {
        match self {
            Self::Files(files) => files.len(),
            Self::Mcap { stamps, .. } => stamps.len(),
        }
    }

    /// First and last stamp.
    pub fn span(&self) -> Option<(Stamp, Stamp)> {
        match self {
            Self::Files(files) => Some((files.first()?.0, files.last()?.0)),
            Self::Mcap { stamps, .. } => Some((*stamps.iter().min()?, *stamps.iter().max()?)),
        }
    }

    /// Reads them one after the other, as they are asked for.
    fn read(&self) -> Box<dyn Iterator<Item = CameraFrame> + Send + '_> {
        match self {
            Self::Files(files) => Box::new(files.iter().map(|(stamp, path)| CameraFrame {
                stamp: *stamp,
                picture: GreyImage::read(path),
                second: None,
            })),
            Self::Mcap { path, topic, .. } => mcap_in::read_images(path.clone(), topic.clone()),
        }
    }
}

impl Recording {
    /// Reads the images one after the other, as they are asked for, each with that of the second camera.
    pub fn camera_frames(&self) -> impl Iterator<Item = CameraFrame> + Send + '_ {
        self.images
            .read()
            .map(|frame| CameraFrame { second: self.second.as_ref().and_then(|s| s.picture(frame.stamp)), ..frame })
    }

    /// Refuses a recording whose inertial samples cannot be, or whose images were taken at another time.
    ///
    /// # Errors
    /// [`VioError::Unusable`] names the recording and what is wrong.
    pub fn check(&self, gravity: f64) -> Result<SampleFindings, VioError> {
        let unusable = |why: String| VioError::Unusable { recording: self.name.clone(), why };
        let findings =
            check_samples(&self.samples, self.imu.rate_hz, gravity).map_err(|error| unusable(error.to_string()))?;
        let Some((first, last)) = self.images.span() else {
            return Err(unusable("there are no images".into()));
        };
        let (began, ended) = (self.samples[0].stamp, self.samples[self.samples.len() - 1].stamp);
        if last < began || first > ended {
            return Err(unusable(format!(
                "the images span {first}..{last} s, the inertial samples {began}..{ended} s: both need the same clock"
            )));
        }
        Ok(findings)
    }
}
