//! What the odometry needs of a camera.

use std::fmt::Debug;

use nalgebra::{Isometry3, Matrix2x3, Unit, Vector2, Vector3};

use super::Camera;
use super::image_side::check_side;
use crate::error::Error;
use crate::error::invalid;
use crate::trajectory::is_finite;

/// A camera: image size, projection and its inverse, pose on the body. [`Camera`](crate::Camera) is one, with the lens models of
/// Kalibr; a caller's own lens goes into [`Vio`](crate::Vio) likewise.
///
/// Camera axes: x right, y down, z forward. Pixel `(0, 0)` is the centre of the top left pixel. Called a few times per landmark
/// and image.
pub trait CameraModel: Debug + Send + Sync {
    /// Pixels per row, and rows.
    fn image_size(&self) -> (usize, usize);

    /// Pose of the camera on the body; the body is the inertial sensor.
    fn body_from_camera(&self) -> Isometry3<f64>;

    /// Pixel of a point in camera axes, which may lie outside the image, and the derivative of the pixel by the point, pixels per
    /// metre. `None` where the model is not one to one.
    fn project_with_jacobian(&self, point_in_camera: &Vector3<f64>) -> Option<(Vector2<f64>, Matrix2x3<f64>)>;

    /// Direction in camera axes that a pixel looks along, the inverse of the projection; `None` where there is none.
    fn bearing(&self, pixel: &Vector2<f64>) -> Option<Unit<Vector3<f64>>>;

    /// As [`project_with_jacobian`](Self::project_with_jacobian), without the derivative.
    fn project(&self, point_in_camera: &Vector3<f64>) -> Option<Vector2<f64>> {
        Some(self.project_with_jacobian(point_in_camera)?.0)
    }

    /// Pixels per radian on the optical axis, of the image axis that has fewer: what angles are worth in pixels.
    fn focal_length(&self) -> f64 {
        let on_axis = self.project_with_jacobian(&Vector3::z());
        on_axis.map_or(f64::NAN, |(_, jacobian)| jacobian.row(0).norm().min(jacobian.row(1).norm()))
    }

    /// The camera as one of Kalibr's, if it is one: only then can its intrinsics be estimated
    /// ([`CalibrationSettings::focal_sigma`](crate::filter::CalibrationSettings::focal_sigma)).
    fn kalibr(&self) -> Option<Camera> {
        None
    }

    /// Refuses a calibration that no camera has.
    fn check(&self) -> Result<(), Error> {
        Ok(())
    }
}

/// Refuses what a filter cannot work with, whatever the model.
pub(crate) fn check_model(camera: &dyn CameraModel) -> Result<(), Error> {
    camera.check()?;
    let (width, height) = camera.image_size();
    for (name, side) in [("width", width), ("height", height)] {
        check_side(name, side)?;
    }
    let focal_length = camera.focal_length();
    if !(focal_length > 0.0 && focal_length.is_finite()) {
        return Err(invalid("focal_length", focal_length, "must be positive and finite, in pixels"));
    }
    if is_finite(&camera.body_from_camera()) {
        Ok(())
    } else {
        Err(Error::NonFinite { what: "body_from_camera", index: 0 })
    }
}
