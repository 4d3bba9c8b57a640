//! The pixel of a landmark in the image of the second camera.

use nalgebra::{Matrix2, Matrix2x4, Vector2};

use super::measurement::{Measurement, Trial};
use crate::filter::settings::{LandmarkSettings, UpdateSettings};
use crate::filter::state::error_state;
use crate::filter::state::inverse_distance::InverseDistance;
use crate::filter::state::landmark::Landmark;
use crate::filter::stereo::rig::StereoRig;
use crate::inertial::iterated_update::Linearization;

/// A pixel of the second camera.
#[derive(Debug)]
pub(crate) struct StereoPixelMeasurement<'a> {
    /// First row of the landmark.
    pub(crate) row: usize,
    pub(crate) pixel: Vector2<f64>,
    /// The landmark in the state.
    pub(crate) landmark: Landmark,
    /// Velocity of its bearing, in tangent coordinates, rad/s.
    pub(crate) rate: Vector2<f64>,
    /// Change of the time offset since the state was propagated to the image, s.
    pub(crate) time_offset_error: f64,
    pub(crate) rig: &'a StereoRig,
    pub(crate) landmarks: &'a LandmarkSettings,
    pub(crate) update: &'a UpdateSettings,
}

impl Measurement<2, 4> for StereoPixelMeasurement<'_> {
    fn rows(&self) -> [usize; 4] {
        let row = self.row;
        [row, row + 1, row + 2, error_state::TIME_OFFSET]
    }

    fn linearize(&self, trial: &Trial<'_, 4>) -> Option<Linearization<2, 4>> {
        let (delta, bearing) = (trial.delta, &self.landmark.bearing);
        let offset = self.time_offset_error + delta[3];
        let moved = Landmark::new(
            bearing.boxplus(&(delta.fixed_rows::<2>(0) + self.rate * offset)),
            InverseDistance::new(self.landmark.inverse_distance.value + delta[2]),
            // Then the projection's warp is the derivative by the tangent coordinates.
            Matrix2::identity(),
        );
        let projection = self.rig.project(&moved)?;
        let mut jacobian = Matrix2x4::zeros();
        jacobian.fixed_columns_mut::<2>(0).copy_from(&projection.warp);
        jacobian.set_column(2, &projection.by_inverse_distance);
        jacobian.set_column(3, &(projection.warp * self.rate));
        let noise = Matrix2::identity() * self.landmarks.pixel_sigma.powi(2);
        Some(Linearization { residual: self.pixel - projection.pixel, jacobian, noise })
    }

    fn max_iterations(&self) -> usize {
        self.update.max_iterations
    }

    fn gate(&self) -> f64 {
        self.update.max_mahalanobis
    }
}
