//! The photometric measurement of a landmark: its patch against the image (Bloesch et al. 2017).

use std::cell::Cell;

use nalgebra::{Matrix2, Matrix2x3, Vector2, Vector3};

use super::measurement::{Measurement, Trial};
use crate::camera::model::CameraModel;
use crate::filter::frontend::patch::{Comparison, Patch};
use crate::filter::frontend::pyramid::Pyramid;
use crate::filter::settings::PatchSettings;
use crate::filter::state::error_state::bearing_and_time;
use crate::filter::state::landmark::Landmark;
use crate::filter::state::rolling_shutter::RollingShutter;
use crate::inertial::iterated_update::Linearization;

/// A patch in an image. The residual is whitened by the square root of the normal matrix of its alignment, so that the 72 pixels of
/// both levels become two values, whatever the warp.
#[derive(Debug)]
pub(crate) struct PatchMeasurement<'a> {
    pub(crate) slot: usize,
    pub(crate) patch: &'a Patch,
    pub(crate) pyramid: &'a Pyramid,
    /// The landmark in the state.
    pub(crate) landmark: Landmark,
    /// Pixels of the patch by tangent coordinates.
    pub(crate) patch_from_tangent: Matrix2<f64>,
    /// Velocity of its bearing, in tangent coordinates, rad/s.
    pub(crate) rate: Vector2<f64>,
    /// Change of the time offset since the state was propagated to the image, s.
    pub(crate) time_offset_error: f64,
    pub(crate) camera: &'a dyn CameraModel,
    pub(crate) shutter: RollingShutter,
    pub(crate) settings: &'a PatchSettings,
    /// Whether only the coarsest level is compared, which reaches farther.
    pub(crate) coarse: Cell<bool>,
    /// The last trial step, and the comparison there.
    pub(crate) last_step: Cell<Vector3<f64>>,
    pub(crate) last_comparison: Cell<Option<Comparison>>,
}

impl PatchMeasurement<'_> {
    /// Pixel after a trial step, and its derivative by tangent coordinates.
    pub(crate) fn project(&self, delta: &Vector3<f64>) -> Option<(Vector2<f64>, Matrix2<f64>)> {
        let step = Vector2::new(delta[0], delta[1]) + self.rate * (self.time_offset_error + delta[2]);
        self.shutter.project(self.camera, &self.landmark.bearing.boxplus(&step), &self.rate)
    }

    /// Compares the coarsest level after a trial step.
    pub(crate) fn compare_coarse(&self, delta: &Vector3<f64>) -> Option<Comparison> {
        let (pixel, by_bearing) = self.project(delta)?;
        self.patch.compare_coarse(self.pyramid, &pixel, &(by_bearing * self.landmark.warp))
    }
}

impl Measurement<2, 3> for PatchMeasurement<'_> {
    fn rows(&self) -> [usize; 3] {
        bearing_and_time(self.slot)
    }

    fn linearize(&self, trial: &Trial<'_, 3>) -> Option<Linearization<2, 3>> {
        self.last_step.set(*trial.delta);
        let (pixel, by_bearing) = self.project(trial.delta)?;
        let warp = by_bearing * self.landmark.warp;
        let comparison = if self.coarse.get() {
            self.patch.compare_coarse(self.pyramid, &pixel, &warp)?
        } else {
            self.patch.compare(self.pyramid, &pixel, &warp)?
        };
        self.last_comparison.set(Some(comparison));
        // In tangent coordinates the derivative of the patch's pixels is the same wherever the patch is compared.
        let factor = comparison.information.cholesky()?.l().transpose();
        let by_tangent = factor * self.patch_from_tangent;
        let mut jacobian = Matrix2x3::zeros();
        jacobian.fixed_columns_mut::<2>(0).copy_from(&by_tangent);
        jacobian.set_column(2, &(by_tangent * self.rate));
        let residual = factor.transpose().solve_lower_triangular(&comparison.gradient)?;
        let intensity = self.settings.intensity_sigma.powi(2).max(comparison.residual / comparison.freedom);
        let floor = by_tangent * by_bearing.try_inverse()? * self.settings.pixel_sigma;
        Some(Linearization { residual, jacobian, noise: Matrix2::identity() * intensity + floor * floor.transpose() })
    }
}
