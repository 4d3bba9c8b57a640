//! Photometric alignment of a landmark's patch with the image.

use std::cell::Cell;

use nalgebra::{Matrix2, Vector2, Vector3};

use super::patch::{LEVELS, Patch};
use super::pyramid::Pyramid;
use crate::camera::model::CameraModel;
use crate::filter::estimator::Estimator;
use crate::filter::measurements::patch::PatchMeasurement;
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

/// Outcome of an alignment.
pub(crate) enum PatchAlignment {
    /// Part of the patch is outside the image.
    OutOfView,
    /// Nothing there fits.
    Failed,
    /// The measurement at the solution.
    Converged(LinearizedMeasurement<2, 3>),
}

/// Aligns a landmark's patch: the best of some guesses, iterations on the coarsest level, then on all; then the gates.
/// `time_offset_error` is the change of the time offset by the updates of this image so far.
pub(crate) fn align_patch(
    estimator: &Estimator,
    slot: usize,
    time_offset_error: f64,
    (patch, pyramid): (&Patch, &Pyramid),
    camera: &dyn CameraModel,
    settings: &Settings,
) -> PatchAlignment {
    let landmark = estimator.state.landmarks[slot];
    let rate = estimator.bearing_rate(&landmark);
    let Some(patch_from_tangent) = landmark.warp.try_inverse() else { return PatchAlignment::Failed };
    let measurement = PatchMeasurement {
        slot,
        patch,
        pyramid,
        landmark,
        patch_from_tangent,
        rate,
        time_offset_error,
        camera,
        shutter: RollingShutter::new(camera, settings),
        settings: &settings.patches,
        coarse: Cell::new(true),
        last_step: Cell::default(),
        last_comparison: Cell::new(None),
    };
    let Some((pixel, by_bearing)) = measurement.project(&Vector3::zeros()) else { return PatchAlignment::OutOfView };
    if !Patch::is_inside(pyramid, &pixel, &(by_bearing * landmark.warp)) {
        return PatchAlignment::OutOfView;
    }
    let first = initial_guess(estimator, &measurement, &by_bearing);
    measurement.last_step.set(first);
    let iteration = Iteration { limit: COARSE_ITERATIONS, tolerance: 1e-2 };
    // Its outcome does not matter, only where it ended: the gates judge the alignment on all levels.
    let _ = linearize_iterated(estimator, &measurement, iteration, first);

    measurement.coarse.set(false);
    measurement.last_comparison.set(None);
    let iteration = Iteration { limit: settings.update.max_iterations, tolerance: 1e-3 };
    let linearized = linearize_iterated(estimator, &measurement, iteration, measurement.last_step.get());
    let (Some(linearized), Some(comparison)) = (linearized, measurement.last_comparison.get()) else {
        return PatchAlignment::Failed;
    };
    let similar = comparison.residual <= settings.patches.max_residual_ratio * comparison.energy;
    if passes_gate(estimator, &linearized, settings.update.max_mahalanobis) && similar {
        PatchAlignment::Converged(linearized)
    } else {
        PatchAlignment::Failed
    }
}

/// The best of some guesses along the longer axis of the predicted uncertainty, over two deviations: photometric alignment
/// converges from a pixel or two only, and the prediction may be off by more.
fn initial_guess(estimator: &Estimator, measurement: &PatchMeasurement, by_bearing: &Matrix2<f64>) -> Vector3<f64> {
    let row = error_state::landmark(measurement.slot);
    let bearing = estimator.covariance.block::<2, 2>(row, row);
    let eigen = (by_bearing * bearing * by_bearing.transpose()).symmetric_eigen();
    let longest = eigen.eigenvalues.imax();
    let deviation = eigen.eigenvalues[longest].max(0.0).sqrt();
    let spacing = GUESS_SPACING / measurement.pyramid.patch_levels()[LEVELS - 1].scale;
    let count = ((2.0 * deviation / spacing).floor() as i32).min(MAX_GUESSES);
    let Some(tangent_from_pixel) = by_bearing.try_inverse() else { return Vector3::zeros() };
    let step: Vector2<f64> = tangent_from_pixel * eigen.eigenvectors.column(longest) * spacing;
    let mut best = (f64::INFINITY, Vector3::zeros());
    if count == 0 {
        return best.1;
    }
    for k in -count..=count {
        let delta = (step * f64::from(k)).push(0.0);
        if let Some(comparison) = measurement.compare_coarse(&delta)
            && comparison.ssd < best.0
        {
            best = (comparison.ssd, delta);
        }
    }
    best.1
}
