//! Photometric alignment of a landmark's patch with the image.

use std::cell::Cell;

use nalgebra::{Matrix2, SMatrix, SVector, Vector2};

use super::patch::{LEVELS, Patch};
use super::patch_slant::SlantEvidence;
use super::pyramid::Pyramid;
use crate::camera::intrinsics::INTRINSICS;
use crate::camera::model::CameraModel;
use crate::filter::estimator::Estimator;
use crate::filter::measurements::patch::{PatchMeasurement, WITH_LENS, WITHOUT_LENS};
use crate::filter::measurements::update::{linearize_iterated, passes_gate};
use crate::filter::settings::Settings;
use crate::filter::state::error_state;
use crate::filter::state::rolling_shutter::RollingShutter;
use crate::inertial::covariance::LinearizedMeasurement;
use crate::inertial::iterated_update::Iteration;

/// Spacing of the initial guesses, in pixels of the patch's coarsest level: half of the alignment's region of convergence.
const GUESS_SPACING: f64 = 1.0;
/// Most guesses to either side of the prediction.
const MAX_GUESSES: i32 = 12;
/// Iterations on the coarsest level alone.
const COARSE_ITERATIONS: usize = 4;
/// Of a patch of which more than this share of the energy remains as residual, what is seen is something else.
const ELSEWHERE: f64 = 0.7;

/// Outcome of an alignment.
pub(crate) enum PatchAlignment<const C: usize> {
    /// Part of the patch is outside the image.
    OutOfView,
    /// Nothing there fits.
    Failed,
    /// Nothing that contradicts the motion: the patch is where it is expected, and looks too different to tell where exactly (blurred, or
    /// seen from elsewhere), or it may be farther from there than is looked.
    Changed,
    /// The measurement at the solution, and how the patch's surface is turned.
    Converged(LinearizedMeasurement<2, C>, Option<SlantEvidence>),
}

/// Aligns a landmark's patch: the best of some guesses, iterations on the coarsest level, then on all; then the gates.
/// `time_offset_error` is the change of the time offset by the updates of this image so far.
pub(crate) fn align_patch<const C: usize>(
    estimator: &Estimator,
    slot: usize,
    time_offset_error: f64,
    (patch, pyramid): (&Patch, &Pyramid),
    camera: &dyn CameraModel,
    settings: &Settings,
) -> PatchAlignment<C> {
    let landmark = estimator.state.landmarks[slot];
    let rate = estimator.bearing_rate(&landmark);
    let Some(patch_from_tangent) = landmark.warp.try_inverse() else { return PatchAlignment::Failed };
    let measurement = PatchMeasurement::<C> {
        row: estimator.state.landmark_row(slot),
        patch,
        pyramid,
        landmark,
        patch_from_tangent,
        rate,
        time_offset_error,
        camera,
        lens: estimator.state.lens,
        shutter: RollingShutter::new(camera, estimator.state.row_time),
        settings: &settings.patches,
        coarse: Cell::new(true),
        last_step: Cell::new(SVector::zeros()),
        last_comparison: Cell::new(None),
    };
    let Some((pixel, by_bearing)) = measurement.project(&SVector::zeros()) else { return PatchAlignment::OutOfView };
    if !Patch::is_inside(pyramid, &pixel, &(by_bearing * landmark.warp)) {
        return PatchAlignment::OutOfView;
    }
    let (first, in_reach) = initial_guess(estimator, &measurement, (&pixel, &by_bearing));
    let failed = if in_reach { PatchAlignment::Failed } else { PatchAlignment::Changed };
    measurement.last_step.set(first);
    let iteration = Iteration { limit: COARSE_ITERATIONS, tolerance: 1e-2 };
    // Its outcome does not matter, only where it ended: the gates judge the alignment on all levels.
    let _ = linearize_iterated(estimator, &measurement, iteration, first);

    measurement.coarse.set(false);
    measurement.last_comparison.set(None);
    let iteration = Iteration { limit: settings.update.max_iterations, tolerance: 1e-3 };
    let linearized = linearize_iterated(estimator, &measurement, iteration, measurement.last_step.get());
    let (Some(linearized), Some(comparison)) = (linearized, measurement.last_comparison.get()) else {
        return failed;
    };
    let ratio = comparison.residual / comparison.energy;
    if ratio > ELSEWHERE || !passes_gate(estimator, &linearized, settings.update.max_mahalanobis) {
        failed
    } else if ratio > settings.patches.max_residual_ratio {
        PatchAlignment::Changed
    } else {
        let there = measurement.project(&measurement.last_step.get());
        let slant = there.and_then(|(pixel, by_bearing)| {
            SlantEvidence::new(&landmark, (patch, pyramid), (&pixel, &by_bearing), &comparison, &settings.patches)
        });
        PatchAlignment::Converged(linearized, slant)
    }
}

/// The best of some guesses along the longer axis of the predicted uncertainty, over two deviations: photometric alignment
/// converges from a pixel or two only, and the prediction may be off by more. Also returns whether the guesses reach that far.
fn initial_guess<const C: usize>(
    estimator: &Estimator,
    measurement: &PatchMeasurement<C>,
    (pixel, by_bearing): (&Vector2<f64>, &Matrix2<f64>),
) -> (SVector<f64, C>, bool) {
    let eigen = predicted(estimator, measurement, (pixel, by_bearing)).symmetric_eigen();
    let longest = eigen.eigenvalues.imax();
    let deviation = eigen.eigenvalues[longest].max(0.0).sqrt();
    let spacing = GUESS_SPACING / measurement.pyramid.patch_levels()[LEVELS - 1].scale;
    let wanted = (2.0 * deviation / spacing).floor() as i32;
    let (count, in_reach) = (wanted.min(MAX_GUESSES), wanted <= MAX_GUESSES);
    let Some(tangent_from_pixel) = by_bearing.try_inverse() else { return (SVector::zeros(), in_reach) };
    let step: Vector2<f64> = tangent_from_pixel * eigen.eigenvectors.column(longest) * spacing;
    let mut best = (f64::INFINITY, SVector::zeros());
    if count == 0 {
        return (best.1, in_reach);
    }
    for k in -count..=count {
        let mut delta = SVector::<f64, C>::zeros();
        delta.fixed_rows_mut::<2>(0).copy_from(&(step * f64::from(k)));
        if let Some(comparison) = measurement.compare_coarse(&delta)
            && comparison.ssd < best.0
        {
            best = (comparison.ssd, delta);
        }
    }
    (best.1, in_reach)
}

/// Covariance of the pixel in which a landmark is expected.
fn predicted<const C: usize>(
    estimator: &Estimator,
    measurement: &PatchMeasurement<C>,
    (pixel, by_bearing): (&Vector2<f64>, &Matrix2<f64>),
) -> Matrix2<f64> {
    let row = measurement.row;
    let by_direction = |covariance: Matrix2<f64>| by_bearing * covariance * by_bearing.transpose();
    let direction = measurement.landmark.bearing.direction();
    let by_lens = measurement.lens.as_ref().filter(|_| C > WITHOUT_LENS);
    let Some(by_lens) = by_lens.and_then(|lens| lens.intrinsics_jacobian(&direction)) else {
        return by_direction(estimator.covariance.block::<2, 2>(row, row));
    };
    // A bearing that was measured through a wrong lens is wrong, and its pixel right.
    let mut jacobian = SMatrix::<f64, 2, { WITH_LENS - 1 }>::zeros();
    jacobian.fixed_columns_mut::<2>(0).copy_from(by_bearing);
    jacobian.fixed_columns_mut::<INTRINSICS>(2).copy_from(&by_lens);
    let by_row_time = by_bearing * measurement.rate * measurement.shutter.rows_after_stamp(pixel);
    jacobian.set_column(2 + INTRINSICS, &by_row_time);
    let rows = std::array::from_fn(|k| if k < 2 { row + k } else { error_state::INTRINSICS + k - 2 });
    jacobian * estimator.covariance.marginal::<{ WITH_LENS - 1 }>(&rows) * jacobian.transpose()
}
