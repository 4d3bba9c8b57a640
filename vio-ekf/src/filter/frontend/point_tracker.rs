//! Points followed from image to image, without any inertial sensor.

use std::sync::Arc;

use nalgebra::UnitQuaternion;

use super::corner_detector::DetectionCriteria;
use super::image_frontend::ImageFrontend;
use super::klt_tracker::KltTracker;
use crate::camera::model::CameraModel;
use crate::camera::model::check_model;
use crate::error::Error;
use crate::filter::point_observation::PointObservation;
use crate::filter::settings::PatchSettings;
use crate::samples::ImageView;

/// Follows some dozens of corners through the images of a camera (Lucas and Kanade 1981); each keeps its id as long as it is found.
/// The prediction is the flow so far: motion that changes by more than eight pixels from image to image is lost, and a new point is
/// looked for within sixty.
#[derive(Debug, Clone)]
pub struct PointTracker {
    camera: Arc<dyn CameraModel>,
    criteria: DetectionCriteria,
    frontend: ImageFrontend,
    tracker: KltTracker,
}

impl PointTracker {
    /// Refuses a camera that cannot be.
    pub fn new(camera: impl CameraModel + 'static, patches: &PatchSettings) -> Result<Self, Error> {
        let camera: Arc<dyn CameraModel> = Arc::new(camera);
        check_model(camera.as_ref())?;
        let frontend = ImageFrontend::new(camera.as_ref(), patches);
        Ok(Self { camera, criteria: DetectionCriteria::from(patches), frontend, tracker: KltTracker::default() })
    }

    /// From here on no point lies where the mask, of the size of the images, is 0.
    pub fn set_mask(&mut self, mask: &ImageView) -> Result<(), Error> {
        let mask = mask.checked(self.camera.image_size())?;
        self.frontend.detector.set_mask(&mask);
        Ok(())
    }

    /// The points that the next image shows; it must be of the camera's size.
    pub fn image(&mut self, image: &ImageView) -> Result<Vec<PointObservation>, Error> {
        self.frontend.set_image(&image.checked(self.camera.image_size())?);
        let ImageFrontend { pyramid, detector, .. } = &mut self.frontend;
        let still = Some(UnitQuaternion::identity());
        self.tracker.track(still, pyramid, (detector, &self.criteria), self.camera.as_ref());
        let ids = self.tracker.observations().map(|(id, _)| id);
        let points = ids.filter_map(|id| Some(PointObservation { id, pixel: self.tracker.pixel(id)? }));
        Ok(points.filter(|point| !detector.is_masked(&point.pixel)).collect())
    }
}
