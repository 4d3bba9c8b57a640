//! Pyramid and detector of the first camera, with memory that is claimed once.

use super::corner_detector::CornerDetector;
use super::patch::LEVELS;
use super::pyramid::Pyramid;
use crate::camera::model::CameraModel;
use crate::filter::settings::PatchSettings;
use crate::samples::ImageView;

/// The current image and what is needed to detect corners in it.
#[derive(Debug, Clone)]
pub(crate) struct ImageFrontend {
    pub(crate) pyramid: Pyramid,
    pub(crate) detector: CornerDetector,
    /// Id of the next landmark.
    pub(crate) next_id: u64,
}

impl ImageFrontend {
    pub(crate) fn new(camera: &dyn CameraModel, settings: &PatchSettings) -> Self {
        let (width, height) = camera.image_size();
        let pyramid = Pyramid::new(width, height, settings.first_level, LEVELS);
        let detector = CornerDetector::new(pyramid.corner_level(), settings.fast_threshold);
        Self { pyramid, detector, next_id: 0 }
    }

    /// Takes the next image.
    pub(crate) fn set_image(&mut self, image: &ImageView) {
        self.pyramid.fill(image);
    }
}
