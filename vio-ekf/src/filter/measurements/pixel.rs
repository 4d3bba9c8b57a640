//! The pixel of a landmark that a tracker of the caller's own has found.

use nalgebra::{Matrix2, Matrix2x3, Vector2};

use super::measurement::{Measurement, Trial};
use crate::camera::model::CameraModel;
use crate::filter::settings::{LandmarkSettings, UpdateSettings};
use crate::filter::state::error_state::bearing_and_time;
use crate::filter::state::landmark::{Landmark, project};
use crate::inertial::iterated_update::Linearization;

/// A pixel of the first camera.
#[derive(Debug)]
pub(crate) struct PixelMeasurement<'a> {
    pub(crate) slot: usize,
    pub(crate) pixel: Vector2<f64>,
    /// The landmark in the state.
    pub(crate) landmark: Landmark,
    /// Velocity of its bearing, in tangent coordinates, rad/s.
    pub(crate) rate: Vector2<f64>,
    /// Change of the time offset since the state was propagated to the image, s.
    pub(crate) time_offset_error: f64,
    /// From the stamp of the image until the row of the pixel is exposed, s.
    pub(crate) delay: f64,
    pub(crate) camera: &'a dyn CameraModel,
    pub(crate) landmarks: &'a LandmarkSettings,
    pub(crate) update: &'a UpdateSettings,
}

impl Measurement<2, 3> for PixelMeasurement<'_> {
    fn rows(&self) -> [usize; 3] {
        bearing_and_time(self.slot)
    }

    fn linearize(&self, trial: &Trial<'_, 3>) -> Option<Linearization<2, 3>> {
        let delta = trial.delta;
        let step = Vector2::new(delta[0], delta[1]) + self.rate * (self.time_offset_error + self.delay + delta[2]);
        let (pixel, by_bearing) = project(self.camera, &self.landmark.bearing.boxplus(&step))?;
        let mut jacobian = Matrix2x3::zeros();
        jacobian.fixed_columns_mut::<2>(0).copy_from(&by_bearing);
        jacobian.set_column(2, &(by_bearing * self.rate));
        let noise = Matrix2::identity() * self.landmarks.pixel_sigma.powi(2);
        Some(Linearization { residual: self.pixel - pixel, jacobian, noise })
    }

    fn max_iterations(&self) -> usize {
        self.update.max_iterations
    }

    fn gate(&self) -> f64 {
        self.update.max_mahalanobis
    }
}
