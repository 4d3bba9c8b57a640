//! A lens of a caller's own: the double-sphere model.

use vio_ekf::camera::CameraModel;
use vio_ekf::nalgebra::{Isometry3, Matrix2x3, Unit, Vector2, Vector3};

/// The double-sphere camera (Usenko, Demmel and Cremers 2018, section IV).
#[derive(Debug, Clone, Copy)]
pub(crate) struct DoubleSphere {
    pub(crate) size: (usize, usize),
    /// Focal lengths `fx`, `fy`.
    pub(crate) focal: [f64; 2],
    pub(crate) centre: [f64; 2],
    /// Distance of the spheres' centres, ξ.
    pub(crate) xi: f64,
    /// Shift of the pinhole, α.
    pub(crate) alpha: f64,
    pub(crate) body_from_camera: Isometry3<f64>,
}

impl CameraModel for DoubleSphere {
    fn image_size(&self) -> (usize, usize) {
        self.size
    }

    fn body_from_camera(&self) -> Isometry3<f64> {
        self.body_from_camera
    }

    /// Eqs. (40) to (45).
    fn project_with_jacobian(&self, p: &Vector3<f64>) -> Option<(Vector2<f64>, Matrix2x3<f64>)> {
        let Self { xi, alpha, .. } = *self;
        let first = p.norm();
        let shifted = xi * first + p.z;
        let second = (p.x * p.x + p.y * p.y + shifted * shifted).sqrt();
        let w1 = if alpha > 0.5 { (1.0 - alpha) / alpha } else { alpha / (1.0 - alpha) };
        let w2 = (w1 + xi) / (2.0 * w1 * xi + xi * xi + 1.0).sqrt();
        let depth = alpha * second + (1.0 - alpha) * shifted;
        // Not so where the point is not finite, either.
        if !(first > 0.0 && p.z > -w2 * first && depth.is_finite()) {
            return None;
        }
        let by_first = p / first;
        let by_shifted = by_first * xi + Vector3::z();
        let by_second = (Vector3::new(p.x, p.y, 0.0) + by_shifted * shifted) / second;
        let by_depth = by_second * alpha + by_shifted * (1.0 - alpha);
        let row = |axis: usize| {
            let mut direct = Vector3::zeros();
            direct[axis] = 1.0;
            ((direct - by_depth * (p[axis] / depth)) * (self.focal[axis] / depth)).transpose()
        };
        let pixel = [0, 1].map(|axis| self.focal[axis] * p[axis] / depth + self.centre[axis]);
        Some((Vector2::from(pixel), Matrix2x3::from_rows(&[row(0), row(1)])))
    }

    /// Eqs. (46) to (51).
    fn bearing(&self, pixel: &Vector2<f64>) -> Option<Unit<Vector3<f64>>> {
        let Self { xi, alpha, .. } = *self;
        let m = Vector2::from([0, 1].map(|axis| (pixel[axis] - self.centre[axis]) / self.focal[axis]));
        let r2 = m.norm_squared();
        if !r2.is_finite() || (alpha > 0.5 && r2 > 1.0 / (2.0 * alpha - 1.0)) {
            return None;
        }
        let z = (1.0 - alpha * alpha * r2) / (alpha * (1.0 - (2.0 * alpha - 1.0) * r2).sqrt() + 1.0 - alpha);
        let scale = (z * xi + (z * z + (1.0 - xi * xi) * r2).sqrt()) / (z * z + r2);
        Some(Unit::new_normalize(Vector3::new(m.x, m.y, z) * scale - Vector3::z() * xi))
    }
}
