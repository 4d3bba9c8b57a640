//! Solution of a window: gyroscope's bias, closed form, refinement, outlier rejection, tests.

use nalgebra::{SMatrix, Unit, Vector3};

use super::closed_form;
use super::gyro_bias;
use super::refinement::{self, Solution};
use super::result::{DynamicOutcome, InitialDistance, InitialMotion};
use super::window::{BIASES, CHANGES, ERRORS, GLOBAL, GRAVITY, InitializationWindow, NOISE, VELOCITY, WindowInput};
use crate::filter::settings::DynamicInitializationSettings;
use crate::filter::state::bearing::Bearing;
use crate::inertial::error_state;
use crate::inertial::preintegration::ImuPreintegration;

/// A point whose error is this many times the median is an outlier.
const OUTLIER_RATIO: f64 = 2.5;
/// The window is solved again if the gyroscope's bias is found so far from that of the preintegrations, rad/s.
const MAX_BIAS_CHANGE: f64 = 3e-3;
/// Who hardly moves may start with the scale known to this only: the distances are then known about as well as
/// [`LandmarkSettings`](crate::filter::LandmarkSettings) has them of a body at rest.
const SLOW_SCALE_SIGMA: f64 = 0.5;
/// As fast as that at most, m/s, two standard deviations included.
const SLOW: f64 = 0.05;
/// And so slow that points turn by no more than this, rad/s, in the median: whatever the scale, and if that is badly mistaken, too.
const SLOW_PARALLAX: f64 = 0.01;
/// Least number of points.
pub(crate) const MIN_POINTS: usize = 10;

/// Solves a window: motion at its last image from preintegrated samples and the directions of points.
///
/// The bias of the gyroscope follows from the directions alone (Kneip and Lynen 2013), velocity, gravity and distances
/// from a closed form (Martinelli 2014), and all of them together with the accelerometer's bias from a nonlinear least squares on
/// the directions. Outliers are left out. `integrate` preintegrates from the first image to each, with a bias of the gyroscope:
/// the correction for another bias is of first order only, so one that is far off is preintegrated anew.
pub(crate) fn solve(
    integrate: impl Fn(&Vector3<f64>) -> Vec<ImuPreintegration>,
    input: &WindowInput,
    settings: &DynamicInitializationSettings,
) -> DynamicOutcome {
    let mut window =
        InitializationWindow { input, preintegrations: integrate(&Vector3::zeros()), gyro_bias: Vector3::zeros() };
    for _ in 0..2 {
        let gyro_bias = gyro_bias::gyro_bias(&window, settings);
        window = InitializationWindow { input, preintegrations: integrate(&gyro_bias), gyro_bias };
    }
    let outcome = solve_with_bias(&window, settings);
    match outcome {
        DynamicOutcome::Converged(motion) if (motion.gyro_bias - window.gyro_bias).norm() > MAX_BIAS_CHANGE => {
            let gyro_bias = motion.gyro_bias;
            solve_with_bias(
                &InitializationWindow { input, preintegrations: integrate(&gyro_bias), gyro_bias },
                settings,
            )
        }
        outcome => outcome,
    }
}

fn solve_with_bias(window: &InitializationWindow, settings: &DynamicInitializationSettings) -> DynamicOutcome {
    let points = window.input.points.len();
    let mut kept: Vec<usize> = (0..points).collect();
    for _ in 0..3 {
        let Some(first) = closed_form::closed_form(window, &kept) else { return DynamicOutcome::Unobservable };
        let Some(found) = refinement::refine(window, &kept, first, settings) else {
            return DynamicOutcome::Inconsistent;
        };
        let typical_error = median(found.point_errors.clone()).max(settings.pixel_sigma);
        let before = kept.len();
        kept = kept
            .into_iter()
            .zip(&found.point_errors)
            .filter(|(_, m)| **m <= OUTLIER_RATIO * typical_error)
            .map(|(k, _)| k)
            .collect();
        if kept.len() < MIN_POINTS.max(points / 2) {
            return DynamicOutcome::Inconsistent;
        }
        if kept.len() == before {
            return if found.converged {
                validate(window, &kept, &found, settings)
            } else {
                DynamicOutcome::Inconsistent
            };
        }
    }
    DynamicOutcome::Inconsistent
}

fn validate(
    window: &InitializationWindow,
    kept: &[usize],
    found: &Solution,
    settings: &DynamicInitializationSettings,
) -> DynamicOutcome {
    let biased = found.global.fixed_rows::<3>(BIASES + 3).amax() > 4.0 * settings.accel_bias_sigma;
    if found.reprojection_error.is_nan() || found.reprojection_error > settings.max_reprojection_error || biased {
        return DynamicOutcome::Inconsistent;
    }
    let motion = at_last_image(window, kept, found);
    let slow = motion.scale_sigma < SLOW_SCALE_SIGMA && is_slow(&motion);
    let known = slow || motion.scale_sigma <= settings.max_scale_sigma;
    if !known || motion.landmarks.len() < MIN_POINTS / 2 {
        return DynamicOutcome::Unobservable;
    }
    DynamicOutcome::Converged(Box::new(motion))
}

fn is_slow(motion: &InitialMotion) -> bool {
    let core = motion.core * motion.covariance * motion.core.transpose();
    let sigma = core.fixed_view::<3, 3>(error_state::VELOCITY, error_state::VELOCITY).trace().sqrt();
    let speed = motion.velocity.norm();
    let nearness = median(motion.landmarks.iter().map(|landmark| landmark.inverse_distance).collect());
    speed + 2.0 * sigma < SLOW && speed * nearness < SLOW_PARALLAX
}

/// The solution moved to the last image.
fn at_last_image(window: &InitializationWindow, kept: &[usize], found: &Solution) -> InitialMotion {
    let global = &found.global;
    let last = &window.preintegrations[window.preintegrations.len() - 1];
    let biases = global.fixed_rows::<6>(BIASES).into_owned();
    let (rotation, moved, _) = last.with_biases(&window.bias_change(&biases));
    let time = last.duration;
    let gravity = global.fixed_rows::<3>(GRAVITY).into_owned();
    let end_from_first = rotation.inverse().to_rotation_matrix().into_inner();
    let velocity = end_from_first * (global.fixed_rows::<3>(VELOCITY) + gravity * time + moved);
    let gravity = end_from_first * gravity;
    let attitude = Bearing::new(&Unit::new_normalize(-gravity)).level();

    // Errors of the core by errors of the unknowns. Turning the end by φ (in the axes of the first image) turns what is
    // expressed in its axes the other way.
    let mut core = SMatrix::<f64, { error_state::CORE }, GLOBAL>::zeros();
    let rotation_by_biases = end_from_first * last.by_biases(0);
    core.fixed_view_mut::<3, 3>(error_state::VELOCITY, VELOCITY).copy_from(&end_from_first);
    core.fixed_view_mut::<3, 3>(error_state::VELOCITY, GRAVITY).copy_from(&(end_from_first * time));
    let by_biases = end_from_first * last.by_biases(3) + velocity.cross_matrix() * rotation_by_biases;
    core.fixed_view_mut::<3, 6>(error_state::VELOCITY, BIASES).copy_from(&by_biases);
    // δ(gravity) = Rᵀ hat(g) δθ, inverted for the two components that it determines.
    let level = attitude.to_rotation_matrix().into_inner() / window.input.gravity;
    let mut tilt = SMatrix::<f64, 3, GLOBAL>::zeros();
    tilt.fixed_view_mut::<3, 3>(0, GRAVITY).copy_from(&(level * end_from_first));
    tilt.fixed_view_mut::<3, 6>(0, BIASES).copy_from(&(level * gravity.cross_matrix() * rotation_by_biases));
    core.fixed_rows_mut::<1>(error_state::ATTITUDE).copy_from(&-tilt.row(1));
    core.fixed_rows_mut::<1>(error_state::ATTITUDE + 1).copy_from(&tilt.row(0));
    core.fixed_view_mut::<6, 6>(error_state::GYRO_BIAS, BIASES).fill_with_identity();

    // What the samples do not show changes the velocity itself, besides what it does to the unknowns.
    let mut by_changes = core * found.by_changes;
    for k in 0..CHANGES {
        let mut own = by_changes.fixed_view_mut::<3, 3>(error_state::VELOCITY, 3 * k);
        own -= end_from_first;
    }
    let mut errors = SMatrix::<f64, { error_state::CORE }, ERRORS>::zeros();
    errors.fixed_columns_mut::<GLOBAL>(0).copy_from(&core);
    errors.fixed_columns_mut::<NOISE>(GLOBAL).copy_from(&by_changes);
    let mut covariance = SMatrix::<f64, ERRORS, ERRORS>::identity() * window.change_variance();
    covariance.fixed_view_mut::<GLOBAL, GLOBAL>(0, 0).copy_from(&found.covariance);

    let landmarks = found.distances_at_last_image(window, kept);
    // As the images know it: what the samples' noise adds is claimed, but no longer window would know it better.
    let scale = |landmark: &InitialDistance| {
        let by_unknowns = landmark.gradient.fixed_rows::<GLOBAL>(0);
        by_unknowns.dot(&(found.covariance * by_unknowns)).sqrt() / landmark.inverse_distance
    };
    let scales: Vec<f64> = landmarks.iter().map(scale).collect();
    InitialMotion {
        velocity,
        attitude,
        gyro_bias: biases.fixed_rows::<3>(0).into_owned(),
        accel_bias: biases.fixed_rows::<3>(3).into_owned(),
        covariance,
        core: errors,
        scale_sigma: if scales.is_empty() { f64::INFINITY } else { median(scales) },
        landmarks,
        duration: time,
        gyro_density: window.input.densities[0],
    }
}

/// The value in the middle; there must be one.
fn median(mut values: Vec<f64>) -> f64 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}
