//! A shutter that exposes one row after the other: a landmark is seen where it is at the time of its row.

use nalgebra::{Matrix2, Vector2};

use super::bearing::Bearing;
use super::landmark::project;
use crate::camera::model::CameraModel;
use crate::filter::settings::Settings;

/// Iterations for the row in which a landmark is seen: each shortens the error by the pixels that it moves per row, some per cent.
const ITERATIONS: usize = 4;

/// When the rows of an image are exposed; the stamp belongs to the middle row.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RollingShutter {
    row_time: f64,
    middle_row: f64,
}

impl RollingShutter {
    pub(crate) fn new(camera: &dyn CameraModel, settings: &Settings) -> Self {
        let middle_row = 0.5 * (camera.image_size().1 as f64 - 1.0);
        Self { row_time: settings.calibration.row_time_s, middle_row }
    }

    /// Seconds from the stamp of the image until a pixel is exposed.
    pub(crate) fn delay(&self, pixel: &Vector2<f64>) -> f64 {
        self.row_time * (pixel.y - self.middle_row)
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
