//! A shutter that exposes one row after the other: a landmark is seen where it is at the time of its row.

use nalgebra::{Matrix2, Vector2};

use super::bearing::Bearing;
use super::landmark::project;
use crate::camera::model::CameraModel;

/// Iterations for the row in which a landmark is seen: each shortens the error by the pixels that it moves per row, some per cent.
const ITERATIONS: usize = 4;

/// When the rows of an image are exposed; the stamp belongs to the middle row.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RollingShutter {
    row_time: f64,
    middle_row: f64,
}

impl RollingShutter {
    pub(crate) fn new(camera: &dyn CameraModel, row_time: f64) -> Self {
        let middle_row = 0.5 * (camera.image_size().1 as f64 - 1.0);
        Self { row_time, middle_row }
    }

    /// The same with rows that take longer.
    pub(crate) fn slower(&self, change: f64) -> Self {
        Self { row_time: self.row_time + change, ..*self }
    }

    /// Seconds from the stamp of the image until a pixel is exposed.
    pub(crate) fn delay(&self, pixel: &Vector2<f64>) -> f64 {
        self.row_time * self.rows_after_stamp(pixel)
    }

    /// Rows from the one that belongs to the stamp down to a pixel: derivative of the delay by the time of a row.
    pub(crate) fn rows_after_stamp(&self, pixel: &Vector2<f64>) -> f64 {
        pixel.y - self.middle_row
    }

    /// Pixel in which a bearing that moves at a rate, tangent coordinates per second, is seen, and its derivative by tangent
    /// coordinates at the time of the stamp.
    ///
    /// The pixel `u` satisfies `u = π(μ ⊞ rate · delay(u))`, hence `(I − J rate r eᵧᵀ) du = J dμ` with the time `r` of a row.
    pub(crate) fn project(
        &self,
        camera: &dyn CameraModel,
        bearing: &Bearing,
        rate: &Vector2<f64>,
    ) -> Option<(Vector2<f64>, Matrix2<f64>)> {
        let (mut pixel, mut by_bearing) = project(camera, bearing)?;
        if self.row_time == 0.0 {
            return Some((pixel, by_bearing));
        }
        for _ in 0..ITERATIONS {
            (pixel, by_bearing) = project(camera, &bearing.boxplus(&(rate * self.delay(&pixel))))?;
        }
        let mut implicit = Matrix2::identity();
        implicit.set_column(1, &(implicit.column(1) - by_bearing * rate * self.row_time));
        Some((pixel, implicit.try_inverse()? * by_bearing))
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Unit;

    use super::*;
    use crate::sim::{Rng, camera_ahead};
    use crate::test_random::signed;

    /// The pixel is that of the bearing at the time of its own row, and the matrix is its derivative by differences.
    #[test]
    fn a_moving_bearing_is_seen_where_it_is_at_the_time_of_its_row() {
        let camera = camera_ahead();
        let (width, height) = camera.image_size();
        let shutter = RollingShutter { row_time: 0.03 / height as f64, middle_row: 0.5 * (height as f64 - 1.0) };
        assert_eq!(shutter.delay(&Vector2::new(7.0, shutter.middle_row + 10.0)), 10.0 * shutter.row_time);
        let mut rng = Rng::new(3);
        let mut checked = 0;
        for _ in 0..300 {
            let middle = Vector2::new(0.5 * width as f64, 0.5 * height as f64);
            let pixel =
                middle + Vector2::new(0.4 * width as f64 * signed(&mut rng), 0.4 * height as f64 * signed(&mut rng));
            let Some(direction) = camera.bearing(&pixel) else { continue };
            let bearing = Bearing::new(&Unit::new_normalize(direction.into_inner()));
            let rate = Vector2::new(signed(&mut rng), signed(&mut rng));
            let seen = |bearing: &Bearing| shutter.project(&camera, bearing, &rate);
            let Some((pixel, jacobian)) = seen(&bearing) else { continue };
            let since = shutter.row_time * (pixel.y - shutter.middle_row);
            let (expected, _) = project(&camera, &bearing.boxplus(&(rate * since))).unwrap();
            assert!((pixel - expected).norm() < 1e-5, "{pixel} for {expected}");
            let h = 1e-5;
            for k in 0..2 {
                let mut step = Vector2::zeros();
                step[k] = h;
                let [plus, minus] = [step, -step].map(|step| seen(&bearing.boxplus(&step)).unwrap().0);
                let slope = (plus - minus) / (2.0 * h);
                let off = (slope - jacobian.column(k)).norm();
                // Of some hundred pixels per radian; a row's motion is a hundredth of that.
                assert!(off < 2e-3 * slope.norm(), "column {k}: {off} of {}", slope.norm());
            }
            checked += 1;
        }
        assert!(checked > 250, "{checked}");
    }
}
