//! What the filter knows of its sensors, before the initialization and after it.

use std::sync::Arc;

use crate::camera::model::CameraModel;
use crate::filter::frontend::image_frontend::ImageFrontend;
use crate::filter::point_observation::PointObservation;
use crate::filter::settings::Settings;
use crate::filter::stationary::detector::StationaryDetector;
use crate::filter::stereo::stereo_camera::StereoCamera;
use crate::samples::{Imu, ImuNoise};
use crate::stamp::Stamp;

/// What a step uses.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Input<'a> {
    /// The current images of [`Sensors`].
    Image,
    /// The points that a tracker of the caller found in an image.
    Points(&'a [PointObservation]),
}

/// Cameras with their current images, inertial sensor, and whether they are at rest.
#[derive(Debug, Clone)]
pub(crate) struct Sensors {
    pub(crate) camera: Arc<dyn CameraModel>,
    pub(crate) noise: ImuNoise,
    pub(crate) settings: Settings,
    pub(crate) last_sample: Option<Imu>,
    pub(crate) frontend: ImageFrontend,
    /// The second camera.
    pub(crate) stereo: Option<StereoCamera>,
    pub(crate) stationary: StationaryDetector,
    /// Whether the last image was taken at rest.
    pub(crate) was_stationary: bool,
}

impl Sensors {
    /// Time of the latest sample; before the first that of an image.
    pub(crate) fn now_or(&self, stamp: Stamp) -> Stamp {
        self.last_sample.map_or(stamp, |sample| sample.stamp)
    }

    /// Both cameras, as they were given.
    pub(crate) fn cameras(&self) -> (&dyn CameraModel, Option<&dyn CameraModel>) {
        (self.camera.as_ref(), self.stereo.as_ref().map(|stereo| stereo.rig.camera.as_ref()))
    }

    /// How far the body may have turned without being seen to, rad.
    pub(crate) fn undetected_angle(&self) -> f64 {
        self.stationary.undetected_angle(self.camera.as_ref())
    }
}
