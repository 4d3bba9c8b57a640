//! The photometric measurement of a landmark: its patch against the image (Bloesch et al. 2017).

use std::cell::Cell;

use nalgebra::{Matrix2, SMatrix, SVector, Vector2};

use super::measurement::{Measurement, Trial};
use crate::camera::Camera;
use crate::camera::intrinsics::INTRINSICS;
use crate::camera::model::CameraModel;
use crate::filter::frontend::patch::{Comparison, Patch};
use crate::filter::frontend::pyramid::Pyramid;
use crate::filter::settings::PatchSettings;
use crate::filter::state::bearing::Bearing;
use crate::filter::state::error_state::bearing_and_camera;
use crate::filter::state::landmark::{Landmark, project};
use crate::filter::state::rolling_shutter::RollingShutter;
use crate::inertial::iterated_update::Linearization;

/// Rows that a patch depends on, without its lens and its shutter and with them.
pub(crate) const WITHOUT_LENS: usize = 3;
pub(crate) const WITH_LENS: usize = WITHOUT_LENS + INTRINSICS + 1;
/// The last of them: the time of a row.
pub(crate) const ROW_TIME: usize = WITH_LENS - 1;

/// A patch in an image, of a lens and a shutter that are known (`C` is 3) or estimated (10). The residual is whitened by the square root of the normal matrix of its alignment, so that the 72 pixels of
/// both levels become two values, whatever the warp.
#[derive(Debug)]
pub(crate) struct PatchMeasurement<'a, const C: usize> {
    /// First row of the landmark.
    pub(crate) row: usize,
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
    /// The camera where its intrinsics are estimated.
    pub(crate) lens: Option<Camera>,
    pub(crate) shutter: RollingShutter,
    pub(crate) settings: &'a PatchSettings,
    /// Whether only the coarsest level is compared, which reaches farther.
    pub(crate) coarse: Cell<bool>,
    /// The last trial step, and the comparison there.
    pub(crate) last_step: Cell<SVector<f64, C>>,
    pub(crate) last_comparison: Cell<Option<Comparison>>,
}

impl<const C: usize> PatchMeasurement<'_, C> {
    /// Pixel after a trial step, and its derivative by tangent coordinates.
    pub(crate) fn project(&self, delta: &SVector<f64, C>) -> Option<(Vector2<f64>, Matrix2<f64>)> {
        let bearing = self.bearing(delta);
        match self.lens_after(delta) {
            Some(lens) => self.shutter.slower(delta[ROW_TIME]).project(&lens, &bearing, &self.rate),
            None => self.shutter.project(self.camera, &bearing, &self.rate),
        }
    }

    fn bearing(&self, delta: &SVector<f64, C>) -> Bearing {
        let step = Vector2::new(delta[0], delta[1]) + self.rate * (self.time_offset_error + delta[2]);
        self.landmark.bearing.boxplus(&step)
    }

    /// The lens after a trial step, where it is estimated.
    fn lens_after(&self, delta: &SVector<f64, C>) -> Option<Camera> {
        let lens = self.lens.as_ref().filter(|_| C > WITHOUT_LENS)?;
        Some(lens.with_intrinsics_changed(&std::array::from_fn(|k| delta[WITHOUT_LENS + k])))
    }

    /// Compares the coarsest level after a trial step.
    pub(crate) fn compare_coarse(&self, delta: &SVector<f64, C>) -> Option<Comparison> {
        let (pixel, by_bearing) = self.project(delta)?;
        self.patch.compare_coarse(self.pyramid, &pixel, &(by_bearing * self.landmark.warp))
    }
}

impl<const C: usize> Measurement<2, C> for PatchMeasurement<'_, C> {
    fn rows(&self) -> [usize; C] {
        bearing_and_camera(self.row)
    }

    fn linearize(&self, trial: &Trial<'_, C>) -> Option<Linearization<2, C>> {
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
        let mut jacobian = SMatrix::<f64, 2, C>::zeros();
        jacobian.fixed_columns_mut::<2>(0).copy_from(&by_tangent);
        jacobian.set_column(2, &(by_tangent * self.rate));
        if let Some(lens) = self.lens_after(trial.delta) {
            // A lens that moves a pixel is a bearing that does.
            let bearing = self.bearing(trial.delta);
            let tangent_by_pixel = project(&lens, &bearing)?.1.try_inverse()?;
            let by_lens = by_tangent * tangent_by_pixel * lens.intrinsics_jacobian(&bearing.direction())?;
            jacobian.columns_mut(WITHOUT_LENS, INTRINSICS).copy_from(&by_lens);
            jacobian.set_column(ROW_TIME, &(by_tangent * self.rate * self.shutter.rows_after_stamp(&pixel)));
        }
        let residual = factor.transpose().solve_lower_triangular(&comparison.gradient)?;
        let intensity = self.settings.intensity_sigma.powi(2).max(comparison.residual / comparison.freedom);
        let floor = by_tangent * by_bearing.try_inverse()? * self.settings.pixel_sigma;
        Some(Linearization { residual, jacobian, noise: Matrix2::identity() * intensity + floor * floor.transpose() })
    }
}
