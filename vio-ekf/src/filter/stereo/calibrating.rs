//! Landmarks in both images while the calibration of both cameras is estimated.

use std::sync::Arc;

use nalgebra::{Matrix2, Matrix3, SMatrix, Vector2};

use super::rig::StereoRig;
use crate::camera::intrinsics::INTRINSICS;
use crate::filter::estimator::Estimator;
use crate::filter::frontend::patch::Patch;
use crate::filter::frontend::pyramid::Pyramid;
use crate::filter::measurements::update::passes_gate;
use crate::filter::settings::Settings;
use crate::filter::state::error_state;
use crate::filter::state::inverse_distance::InverseDistance;
use crate::filter::state::landmark::{Landmark, project};
use crate::inertial::covariance::LinearizedMeasurement;

/// Inverse distance, both lenses, and the pose of one camera against the other.
const ROWS: usize = 1 + 2 * INTRINSICS + 6;
/// Standard deviations to either side over which a landmark is searched for, along its epipolar line and across it.
const DEVIATIONS: [f64; 2] = [3.0, 2.0];
/// Farthest from the epipolar line, pixels.
const MAX_ACROSS: f64 = 12.0;
/// Candidates along the line at most, a pixel apart.
const MAX_CANDIDATES: f64 = 200.0;
/// Largest correction of a candidate by the alignment, pixels; length of its last step; its steps at most.
const MAX_CORRECTION: f64 = 2.0;
const TOLERANCE: f64 = 0.01;
const MAX_STEPS: usize = 10;

/// Updates with all landmarks that both images show. What is measured is the pixel of the second image in which the patch of the first
/// one lies: it depends on the distance, on both lenses and on how the cameras stand to each other.
pub(super) fn update_with_pairs(estimator: &mut Estimator, images: (&Pyramid, &Pyramid), settings: &Settings) {
    for slot in 0..estimator.state.landmarks.len() {
        let Some(measurement) = measure(estimator, slot, images, settings) else { continue };
        if passes_gate(estimator, &measurement, settings.update.max_mahalanobis) {
            estimator.update(&measurement);
        }
    }
}

fn measure(
    estimator: &Estimator,
    slot: usize,
    (first, second): (&Pyramid, &Pyramid),
    settings: &Settings,
) -> Option<LinearizedMeasurement<2, ROWS>> {
    let (lens, other) = (estimator.state.lens?, estimator.state.second?);
    let rig = StereoRig::posed(&other.from_first, Arc::new(other.lens));
    let landmark = estimator.state.landmarks[slot];
    let row = estimator.state.landmark_row(slot) + 2;
    let (pixel, by_bearing) = project(&lens, &landmark.bearing)?;
    let patch = Patch::extract(first, &pixel)?;
    let there = landmark.extracted_again(by_bearing.try_inverse()?)?;
    let at = |value: f64| rig.project(&Landmark { inverse_distance: InverseDistance::new(value), ..there });
    let jacobian = |value: f64| {
        let projection = at(value)?;
        let direction = landmark.bearing.direction();
        let turned = other.from_first.rotation * direction;
        let seen = turned + other.from_first.translation.vector * value;
        let (_, by_point) = other.lens.project_with_jacobian(&seen)?;
        let mut jacobian = SMatrix::<f64, 2, ROWS>::zeros();
        jacobian.set_column(0, &projection.by_inverse_distance);
        // The patch is what it is in the first image: where its lens is off, so is the bearing.
        let by_first = -projection.warp * lens.intrinsics_jacobian(&direction)?;
        jacobian.fixed_columns_mut::<INTRINSICS>(1).copy_from(&by_first);
        jacobian.fixed_columns_mut::<INTRINSICS>(1 + INTRINSICS).copy_from(&other.lens.intrinsics_jacobian(&seen)?);
        jacobian.fixed_columns_mut::<3>(1 + 2 * INTRINSICS).copy_from(&(-by_point * turned.cross_matrix()));
        jacobian.fixed_columns_mut::<3>(4 + 2 * INTRINSICS).copy_from(&(by_point * Matrix3::identity() * value));
        Some(jacobian)
    };
    let rows: [usize; ROWS] = std::array::from_fn(|k| match k {
        0 => row,
        k if k <= INTRINSICS => error_state::INTRINSICS + k - 1,
        k => error_state::SECOND_INTRINSICS + k - 1 - INTRINSICS,
    });
    let expected = landmark.inverse_distance.value;
    let deviation = estimator.covariance.variance(row).max(0.0).sqrt();

    // Where it may be: along the line by its distance, across it by what is not known of the cameras.
    let by_state = jacobian(expected)?;
    let spread = by_state * estimator.covariance.marginal(&rows) * by_state.transpose();
    let along = by_state.column(0).try_normalize(0.0)?;
    let across = Vector2::new(-along.y, along.x);
    let sideways = (DEVIATIONS[1] * across.dot(&(spread * across)).max(0.0).sqrt()).min(MAX_ACROSS).floor() as i32;
    let half = (DEVIATIONS[0] * deviation)
        .max(DEVIATIONS[0] * along.dot(&(spread * along)).max(0.0).sqrt() / by_state.column(0).norm());
    let (low, high) = (expected - half, (expected + half).min(1.0 / settings.stereo.min_distance_m));
    let count = ((high - low) * by_state.column(0).norm()).ceil().clamp(1.0, MAX_CANDIDATES) as u32;
    let mut best: Option<(f64, f64, Vector2<f64>)> = None;
    for k in 0..count {
        let value = low + (high - low) * (f64::from(k) + 0.5) / f64::from(count);
        let Some(projection) = at(value) else { continue };
        for offset in -sideways..=sideways {
            let pixel = projection.pixel + across * f64::from(offset);
            let Some(comparison) = patch.compare_coarse(second, &pixel, &projection.warp) else { continue };
            if best.is_none_or(|(least, ..)| comparison.ssd < least) {
                best = Some((comparison.ssd, value, pixel));
            }
        }
    }
    let (_, value, start) = best?;

    // Alignment in both directions.
    let warp = at(value)?.warp;
    let mut pixel = start;
    for _ in 0..MAX_STEPS {
        let comparison = patch.compare(second, &pixel, &warp)?;
        let covariance = comparison.information.try_inverse()?;
        let step = warp * covariance * comparison.gradient;
        pixel += step;
        if step.norm() > TOLERANCE {
            continue;
        }
        let near = (pixel - start).norm() <= MAX_CORRECTION;
        let similar = comparison.residual <= settings.patches.max_residual_ratio * comparison.energy;
        if !(near && similar) {
            return None;
        }
        // Linear where the patch is, not where it was expected.
        let value = value + by_state.column(0).dot(&(pixel - at(value)?.pixel)) / by_state.column(0).norm_squared();
        let jacobian = jacobian(value)?;
        let residual = pixel - at(value)?.pixel + jacobian.column(0) * (value - expected);
        let intensity = (2.0 * settings.patches.intensity_sigma.powi(2)).max(comparison.residual / comparison.freedom);
        let noise = warp * covariance * warp.transpose() * intensity
            + Matrix2::identity() * settings.stereo.pixel_sigma.powi(2);
        return Some(LinearizedMeasurement { rows, residual, jacobian, noise });
    }
    None
}
