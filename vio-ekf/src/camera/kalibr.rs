//! Kalibr's lenses as cameras of the odometry.

use nalgebra::{Isometry3, Matrix2x3, Unit, Vector2, Vector3};

use super::model::CameraModel;
use super::{Camera, Distortion};
use crate::error::Error;

impl CameraModel for Camera {
    fn image_size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    fn body_from_camera(&self) -> Isometry3<f64> {
        self.body_from_camera
    }

    fn project_with_jacobian(&self, point_in_camera: &Vector3<f64>) -> Option<(Vector2<f64>, Matrix2x3<f64>)> {
        Self::project_with_jacobian(self, point_in_camera)
    }

    fn bearing(&self, pixel: &Vector2<f64>) -> Option<Unit<Vector3<f64>>> {
        Self::bearing(self, pixel)
    }

    fn project(&self, point_in_camera: &Vector3<f64>) -> Option<Vector2<f64>> {
        Self::project(self, point_in_camera)
    }

    fn focal_length(&self) -> f64 {
        // The unified models put a sphere in between.
        let on_axis = match self.distortion {
            Distortion::Omni { xi, .. } | Distortion::DoubleSphere([xi, _]) => 1.0 + xi,
            _ => 1.0,
        };
        self.fx.min(self.fy) / on_axis
    }

    fn kalibr(&self) -> Option<Self> {
        Some(*self)
    }

    fn check(&self) -> Result<(), Error> {
        Self::check(self)
    }
}
