//! A recording: its sensors, their samples, and where its images are.

use std::path::PathBuf;

use vio_ekf::format::calibration::{CameraCalibration, ImuCalibration};
use vio_ekf::imu_check::{ImuValidation, validate_samples};
use vio_ekf::run::{CalibrationDoubt, GroundTruth};
use vio_ekf::{Camera, Imu, Stamp};

use super::error::VioError;
use super::grey_image::GreyImage;

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
    /// Topics with images or inertial samples that are not used.
    pub unused: Vec<String>,
    /// What is not known of the sensors, and what is assumed instead.
    pub assumed: Vec<String>,
    /// Of the size of the first camera's images: nothing is tracked where it is 0.
    pub mask: Option<GreyImage>,
}

/// A second camera, recorded beside the first.
#[derive(Debug, Clone)]
pub struct SecondCamera {
    /// The camera on the body.
    pub camera: Camera,
    /// Its images, by rising stamps.
    pub images: Images,
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
}

impl Recording {
    /// Refuses a recording whose inertial samples cannot be, or whose images were taken at another time.
    ///
    /// # Errors
    /// [`VioError::Unusable`] names the recording and what is wrong.
    pub fn check(&self, gravity: f64) -> Result<ImuValidation, VioError> {
        let unusable = |why: String| VioError::Unusable { recording: self.name.clone(), why };
        let findings =
            validate_samples(&self.samples, self.imu.rate_hz, gravity).map_err(|error| unusable(error.to_string()))?;
        self.check_clocks()?;
        Ok(findings)
    }

    /// Puts what was found in place of what is doubted of the calibration.
    pub(super) fn correct_calibration(&mut self, doubt: &CalibrationDoubt) {
        let second = self.second.iter().map(|second| CameraCalibration { camera: second.camera, ..self.camera });
        let mut cameras: Vec<CameraCalibration> = std::iter::once(self.camera).chain(second).collect();
        doubt.correct(&mut cameras);
        doubt.correct_samples(&mut self.samples);
        self.camera = cameras[0];
        if let (Some(second), Some(corrected)) = (&mut self.second, cameras.get(1)) {
            second.camera = corrected.camera;
        }
    }

    /// The calibration of the first camera in a line.
    pub(super) fn calibration_words(&self) -> String {
        let CameraCalibration { camera, time_offset_s, row_time_s, .. } = &self.camera;
        let Camera { fx, fy, cx, cy, distortion, .. } = camera;
        let shutter = match 1e6 * row_time_s {
            0.0 => String::new(),
            micros => format!(", line delay {micros:.1} us"),
        };
        format!(
            "focal lengths {fx:.1}, {fy:.1} px, principal point {cx:.1}, {cy:.1} px, {distortion:.3?}, clock {:.1} ms{shutter}",
            1e3 * time_offset_s
        )
    }

    /// Refuses a recording whose images were taken at another time than its inertial samples.
    ///
    /// # Errors
    /// [`VioError::Unusable`] names the recording and what is wrong.
    pub fn check_clocks(&self) -> Result<(), VioError> {
        let unusable = |why: String| VioError::Unusable { recording: self.name.clone(), why };
        let Some((first, last)) = self.images.span() else {
            return Err(unusable("there are no images".into()));
        };
        let [Some(began), Some(ended)] = [self.samples.first(), self.samples.last()].map(|s| s.map(|s| s.stamp)) else {
            return Err(unusable("there are no inertial samples".into()));
        };
        if last < began || first > ended {
            let rate = (self.samples.len() - 1) as f64 / ended.secs_since(began).max(1e-9);
            return Err(unusable(format!(
                "the images span {first}..{last} s, the inertial samples {began}..{ended} s at {rate:.0} Hz: both need the same clock, \
                 and the same unit of the stamps"
            )));
        }
        Ok(())
    }
}
