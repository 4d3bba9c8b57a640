//! The second camera, fixed beside the first.

use std::sync::Arc;

use nalgebra::{Isometry3, Matrix2, Vector2};

use crate::camera::model::CameraModel;
use crate::filter::propagation::camera_motion::CameraMotion;
use crate::filter::state::landmark::{Landmark, project};

/// The second camera and its extrinsics, which are taken as known.
#[derive(Debug, Clone)]
pub(crate) struct StereoRig {
    pub(crate) camera: Arc<dyn CameraModel>,
    /// As if the first camera had moved to the second one's pose.
    second_from_first: CameraMotion,
}

/// Where the second camera sees a landmark.
pub(crate) struct StereoProjection {
    pub(crate) pixel: Vector2<f64>,
    /// Pixels of the image per pixel of the patch.
    pub(crate) warp: Matrix2<f64>,
    /// Derivative of the pixel by the inverse distance: along the epipolar line.
    pub(crate) by_inverse_distance: Vector2<f64>,
}

impl StereoRig {
    pub(crate) fn new(first: &dyn CameraModel, camera: Arc<dyn CameraModel>) -> Self {
        let second_from_first = CameraMotion::between(&first.body_from_camera(), &camera.body_from_camera());
        Self { camera, second_from_first }
    }

    /// From the pose of the first camera in the second one's axes.
    pub(crate) fn posed(from_first: &Isometry3<f64>, camera: Arc<dyn CameraModel>) -> Self {
        let second_from_first = CameraMotion::between(from_first, &Isometry3::identity());
        Self { camera, second_from_first }
    }

    /// Projects a landmark of the first camera into the second image.
    pub(crate) fn project(&self, landmark: &Landmark) -> Option<StereoProjection> {
        let (seen, transition) = self.second_from_first.transform(landmark)?;
        let (pixel, by_bearing) = project(self.camera.as_ref(), &seen.bearing)?;
        let by_inverse_distance = by_bearing * transition.by_itself.fixed_view::<2, 1>(0, 2);
        Some(StereoProjection { pixel, warp: by_bearing * seen.warp, by_inverse_distance })
    }
}
