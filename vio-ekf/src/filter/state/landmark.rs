//! Landmarks in robocentric coordinates, and how a camera sees them.

use nalgebra::{Matrix2, Vector2, Vector3};

use super::bearing::Bearing;
use super::inverse_distance::InverseDistance;
use crate::camera::model::CameraModel;

/// A point of the scene in the axes of the camera that sees it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Landmark {
    pub(crate) bearing: Bearing,
    /// `ρ = 1/d`, 1/m.
    pub(crate) inverse_distance: InverseDistance,
    /// Tangent coordinates per pixel of the patch as it was extracted: how the patch has been deformed since.
    pub(crate) warp: Matrix2<f64>,
    /// Inverse distance per pixel of the patch: its surface is a plane (Molton, Davison and Reid 2004).
    pub(crate) slope: Vector2<f64>,
    /// Tangent coordinates and inverse distance by the inverse distance when the patch was extracted: the parallax since.
    pub(crate) by_distance: Vector3<f64>,
}

impl Landmark {
    /// With a patch that is extracted now, of a surface that faces the camera.
    pub(crate) fn new(bearing: Bearing, inverse_distance: InverseDistance, warp: Matrix2<f64>) -> Self {
        Self { bearing, inverse_distance, warp, slope: Vector2::zeros(), by_distance: Vector3::z() }
    }

    /// The same surface with a patch that is extracted now; `warp` is tangent coordinates by its pixels.
    pub(crate) fn extracted_again(&self, warp: Matrix2<f64>) -> Option<Self> {
        let old_by_new = self.warp.try_inverse()? * warp;
        Some(Self { warp, slope: old_by_new.tr_mul(&self.slope), by_distance: Vector3::z(), ..*self })
    }

    /// Changes the slope that the patch had when it was extracted.
    pub(crate) fn tilt(&mut self, change: &Vector2<f64>) {
        self.warp += self.by_distance.xy() * change.transpose();
        self.slope += change * self.by_distance.z;
    }
}

/// Pixel of a bearing and its derivative by the bearing's tangent coordinates.
pub(crate) fn project(camera: &dyn CameraModel, bearing: &Bearing) -> Option<(Vector2<f64>, Matrix2<f64>)> {
    let (pixel, jacobian) = camera.project_with_jacobian(&bearing.direction())?;
    Some((pixel, jacobian * bearing.differential()))
}

/// Bearing of a pixel, and tangent coordinates by pixels there.
pub(crate) fn unproject(camera: &dyn CameraModel, pixel: &Vector2<f64>) -> Option<(Bearing, Matrix2<f64>)> {
    let bearing = Bearing::new(&camera.bearing(pixel)?);
    Some((bearing, project(camera, &bearing)?.1.try_inverse()?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Camera;
    use crate::sim::Rng;
    use crate::test_random::signed;

    #[test]
    fn pixels_move_with_the_bearing() {
        let (mut rng, camera) = (Rng::new(5), Camera::euroc());
        for _ in 0..200 {
            let pixel = Vector2::new(376.0 + 370.0 * signed(&mut rng), 240.0 + 235.0 * signed(&mut rng));
            let bearing = Bearing::new(&camera.bearing(&pixel).unwrap());
            let (seen, jacobian) = project(&camera, &bearing).unwrap();
            assert!((seen - pixel).amax() < 1e-9);
            for k in 0..2 {
                let h = 1e-6;
                let mut step = Vector2::zeros();
                step[k] = h;
                let [a, b] = [step, -step].map(|s| project(&camera, &bearing.boxplus(&s)).unwrap().0);
                assert!(((a - b) / (2.0 * h) - jacobian.column(k)).amax() < 1e-4);
            }
        }
    }
}
