use nalgebra::{Matrix2, Matrix2x3, Vector2, Vector3};

use super::Track;
use super::covariance::Measurement;
use super::estimator::{Estimator, bearing_part, bearing_rows};
use super::patch::{Comparison, LEVELS, Patch};
use super::points::project;
use super::pyramid::Pyramid;
use super::settings::{PatchSettings, Settings};
use super::state::at;
use super::update::{Iteration, Linearised, iterate, mahalanobis};
use crate::Camera;

/// Spacing of the places at which a patch is looked for first, in pixels of its coarsest level: half of what the
/// iteration reaches from.
const SEED_SPACING: f64 = 1.0;
/// Most such places to either side of the prediction.
const MAX_SEEDS: i32 = 12;
/// Iterations on the coarsest level alone.
const COARSE_ITERATIONS: usize = 4;

/// What came of looking for a landmark.
pub(super) enum Look {
    /// Part of it is outside the image.
    Outside,
    /// Nothing there fits.
    Lost,
    /// Found, with what the comparison at the solution left unexplained.
    Found(Measurement<2, 3>),
}

/// Finds a landmark's patch in the image and turns what is seen into a measurement.
pub(super) fn look_for(
    estimator: &Estimator,
    slot: usize,
    late: f64,
    patch: &Patch,
    pyramid: &Pyramid,
    camera: &Camera,
    settings: &Settings,
) -> Look {
    let landmark = estimator.state.landmarks[slot];
    let rate = estimator.tangent_rate(&landmark);
    let Some(patch_from_tangent) = landmark.warp.try_inverse() else { return Look::Lost };
    let place = |delta: &Vector3<f64>| {
        let bearing = landmark.bearing.boxplus(&(bearing_part(delta) + rate * (late + delta[2])));
        project(camera, &bearing)
    };
    let Some((pixel, by_bearing)) = place(&Vector3::zeros()) else { return Look::Outside };
    if !Patch::fits(pyramid, &pixel, &(by_bearing * landmark.warp)) {
        return Look::Outside;
    }

    // In tangent coordinates the derivative of what the patch's pixels say is the same wherever the patch is looked for.
    let linearised = |comparison: &Comparison, by_bearing: &Matrix2<f64>| {
        let factor = comparison.information.cholesky()?.l().transpose();
        let own = factor * patch_from_tangent;
        let mut jacobian = Matrix2x3::zeros();
        jacobian.fixed_columns_mut::<2>(0).copy_from(&own);
        jacobian.set_column(2, &(own * rate));
        let residual = factor.transpose().solve_lower_triangular(&comparison.moment)?;
        let grey = settings.patches.grey_sigma.powi(2).max(comparison.unexplained / comparison.freedom);
        let floor = own * by_bearing.try_inverse()? * settings.patches.pixel_sigma;
        Some(Linearised { residual, jacobian, noise: Matrix2::identity() * grey + floor * floor.transpose() })
    };
    let (rows, covariance) = (bearing_rows(slot), &estimator.covariance);

    let first = seed(estimator, slot, &by_bearing, pyramid, |delta| {
        let (pixel, by_bearing) = place(delta)?;
        Some(patch.compare_coarse(pyramid, &pixel, &(by_bearing * landmark.warp))?.mismatch)
    });
    let mut coarse = first;
    let iteration = Iteration { limit: COARSE_ITERATIONS, tolerance: 1e-2 };
    let _ = iterate(covariance, rows, iteration, first, |delta| {
        coarse = *delta;
        let (pixel, by_bearing) = place(delta)?;
        linearised(&patch.compare_coarse(pyramid, &pixel, &(by_bearing * landmark.warp))?, &by_bearing)
    });

    let mut last = None;
    let iteration = Iteration { limit: settings.gates.iterations, tolerance: 1e-3 };
    let measurement = iterate(covariance, rows, iteration, coarse, |delta| {
        let (pixel, by_bearing) = place(delta)?;
        let comparison = patch.compare(pyramid, &pixel, &(by_bearing * landmark.warp))?;
        last = Some(comparison);
        linearised(&comparison, &by_bearing)
    });
    let (Some(measurement), Some(comparison)) = (measurement, last) else { return Look::Lost };
    let clear = comparison.unexplained <= settings.patches.unexplained * comparison.energy;
    match mahalanobis(covariance, &measurement) {
        Some(distance) if clear && distance <= settings.gates.mahalanobis => Look::Found(measurement),
        _ => Look::Lost,
    }
}

/// Where to begin: the best of some places along the longer axis of the predicted uncertainty, over two deviations.
fn seed(
    estimator: &Estimator,
    slot: usize,
    by_bearing: &Matrix2<f64>,
    pyramid: &Pyramid,
    mut mismatch: impl FnMut(&Vector3<f64>) -> Option<f64>,
) -> Vector3<f64> {
    let row = at::landmark(slot);
    let bearing = estimator.covariance.block::<2, 2>(row, row);
    let eigen = (by_bearing * bearing * by_bearing.transpose()).symmetric_eigen();
    let longest = eigen.eigenvalues.imax();
    let deviation = eigen.eigenvalues[longest].max(0.0).sqrt();
    let spacing = SEED_SPACING / pyramid.used()[LEVELS - 1].scale;
    let count = ((2.0 * deviation / spacing).floor() as i32).min(MAX_SEEDS);
    let Some(tangent_from_pixel) = by_bearing.try_inverse() else { return Vector3::zeros() };
    let step: Vector2<f64> = tangent_from_pixel * eigen.eigenvectors.column(longest) * spacing;
    let mut best = (f64::INFINITY, Vector3::zeros());
    if count == 0 {
        return best.1;
    }
    for k in -count..=count {
        let delta = (step * f64::from(k)).push(0.0);
        if let Some(mismatch) = mismatch(&delta)
            && mismatch < best.0
        {
            best = (mismatch, delta);
        }
    }
    best.1
}

/// Takes a patch anew where it is now if it is seen at another scale. What is followed from then on is another point: the
/// one that is seen exactly where the filter believes the old one to be.
pub(super) fn refresh(
    estimator: &mut Estimator,
    slot: usize,
    track: &mut Track,
    pyramid: &Pyramid,
    camera: &Camera,
    settings: &PatchSettings,
) {
    let landmark = estimator.state.landmarks[slot];
    let Some((pixel, by_bearing)) = project(camera, &landmark.bearing) else { return };
    let area = (by_bearing * landmark.warp).determinant();
    if (1.0 / settings.rescale..=settings.rescale).contains(&area) {
        return;
    }
    let (Some(patch), Some(warp)) = (Patch::take(pyramid, &pixel), by_bearing.try_inverse()) else { return };
    if patch.score() < settings.score {
        return;
    }
    track.patch = Some(patch);
    estimator.renew(slot, warp, &(warp * warp.transpose() * settings.pixel_sigma.powi(2)));
}
