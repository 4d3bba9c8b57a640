//! The initialization in motion on exact and on noisy directions of points.

use nalgebra::{Isometry3, Point3, SVector, UnitQuaternion, Vector3};

use super::result::{DynamicOutcome, InitialMotion};
use super::solver::solve;
use super::window::{BearingObservation, WindowInput};
use crate::filter::settings::DynamicInitializationSettings;
use crate::inertial::error_state;
use crate::inertial::preintegration::ImuPreintegration;
use crate::lie::so3;
use crate::samples::ImuNoise;
use crate::stamp::Stamp;
use crate::trajectory::spline::Spline;

const FOCAL_LENGTH: f64 = 460.0;
const GRAVITY: f64 = 9.81;

/// A number in `[-1, 1)` from an index: enough randomness for noise.
fn noise(k: usize) -> f64 {
    let z = (k as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    ((z ^ (z >> 27)) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
}

/// What is true at the end of a window.
struct Truth {
    velocity: Vector3<f64>,
    body_from_world: UnitQuaternion<f64>,
    biases: [Vector3<f64>; 2],
    distances: Vec<f64>,
}

/// What is wrong with the first points of a window.
#[derive(Clone, Copy)]
enum Mistaken {
    None,
    /// So many are drawn along by something that moves.
    Drawn(usize),
    /// So many pass the wrong way, as something mirrored does, so many times as far away: there is no distance at which they would.
    Mirrored(usize, f64),
}

/// A flight with the given speed, m/s, and strength of its accelerations, seen for two seconds; half of the points come into sight later.
fn window(
    (speed, agility): (f64, f64),
    biases: [Vector3<f64>; 2],
    (pixel_sigma, accel_density): (f64, f64),
    mistaken: Mistaken,
    seed: usize,
) -> (DynamicOutcome, Truth) {
    let knots = (0..60).map(|k| {
        let t = f64::from(k) * 0.05;
        let sway = |f: f64, p: f64| (f * t + p + seed as f64).sin();
        let position =
            Vector3::new(speed * t, 0.0, 0.0) + Vector3::new(sway(2.1, 0.0), sway(2.9, 1.0), sway(2.3, 2.0)) * agility;
        let turn = Vector3::new(0.2 * sway(1.3, 0.5), 0.2 * sway(1.9, 2.5), 0.3 * t);
        Isometry3::from_parts(position.into(), so3::exp(&turn))
    });
    let spline = Spline::new(Stamp::from_nanos(0), 50_000_000, knots.collect()).unwrap();
    let at = |nanos: i64| spline.sample(Stamp::from_nanos(100_000_000 + nanos)).unwrap();
    // Without acceleration, a camera that swings about the sensor would know the scale from that.
    let lever = if agility > 0.0 { Vector3::new(0.1, -0.05, 0.02) } else { Vector3::zeros() };
    let camera = (lever, so3::exp(&Vector3::new(0.3, 1.2, -0.4)));
    let body_from_camera = Isometry3::from_parts(camera.0.into(), camera.1);
    let images = 40;
    // A mean over a step; of a uniform number the deviation is 1/√3.
    let force_noise = |image: usize, step: i64| {
        let at = 3 * (10 * image + step as usize) + 100_000 * (seed + 1);
        Vector3::from_fn(|axis, _| noise(at + axis)) * (3.0 / 0.005_f64).sqrt() * accel_density
    };
    let integrate = |bias: &Vector3<f64>| {
        let mut preintegrations = vec![ImuPreintegration::default()];
        for image in 1..=images {
            let mut preintegration = preintegrations[image - 1].clone();
            for step in 0..10 {
                // Readings in the middle of each step, as the mean of two samples is.
                let m = at((image as i64 - 1) * 50_000_000 + step * 5_000_000 + 2_500_000);
                let (rate, force) = (
                    m.rate_in_body + biases[0] - bias,
                    m.specific_force(GRAVITY) + biases[1] + force_noise(image, step),
                );
                preintegration.integrate(&rate, &force, 0.005, &ImuNoise::ZERO);
            }
            preintegrations.push(preintegration);
        }
        preintegrations
    };
    let camera_pose = |image: usize| at(image as i64 * 50_000_000).world_from_body * body_from_camera;
    let mut distances = Vec::new();
    let points: Vec<Vec<BearingObservation>> = (0..24)
        .map(|k| {
            let local = Vector3::new(noise(7 * k + seed), noise(7 * k + 1 + seed), 1.0).normalize()
                * (3.0 + 2.0 * noise(7 * k + 2));
            let point = camera_pose(0) * Point3::from(local);
            distances.push((camera_pose(images).inverse() * point).coords.norm());
            (k % 2 * 10..=images)
                .map(|image| {
                    let mut seen = (camera_pose(image).inverse() * point).coords;
                    let jitter = Vector3::from_fn(|i, _| noise(1000 * k + 50 * image + i + 31 * seed)) * 1.73;
                    match mistaken {
                        Mistaken::Drawn(count) if k < count => {
                            seen = seen.normalize() + Vector3::new(0.01 * image as f64, 0.0, 0.0);
                        }
                        Mistaken::Mirrored(count, farther) if k < count => {
                            let (first, mut back) = (camera_pose(0), camera_pose(image));
                            back.translation.vector = 2.0 * first.translation.vector - back.translation.vector;
                            seen = (back.inverse() * (first * Point3::from(local * farther))).coords.normalize();
                        }
                        _ => seen = seen.normalize(),
                    }
                    (image, (seen + jitter * (pixel_sigma / FOCAL_LENGTH)).normalize())
                })
                .collect()
        })
        .collect();
    let densities = [0.0, accel_density];
    let input = WindowInput { points: &points, camera, focal_length: FOCAL_LENGTH, gravity: GRAVITY, densities };
    let found = solve(integrate, &input, &DynamicInitializationSettings::default());
    let end = at(images as i64 * 50_000_000);
    let body_from_world: UnitQuaternion<f64> = end.world_from_body.rotation.inverse();
    let velocity = body_from_world * end.velocity_in_world;
    (found, Truth { velocity, body_from_world, biases, distances })
}

fn converged(outcome: DynamicOutcome) -> Option<InitialMotion> {
    match outcome {
        DynamicOutcome::Converged(motion) => Some(*motion),
        _ => None,
    }
}

/// Errors of velocity, roll and pitch, and biases.
fn errors(found: &InitialMotion, truth: &Truth) -> SVector<f64, { error_state::CORE }> {
    let mut errors = SVector::<f64, { error_state::CORE }>::zeros();
    errors.fixed_rows_mut::<3>(error_state::VELOCITY).copy_from(&(truth.velocity - found.velocity));
    // The yaw is arbitrary: the turn between the two verticals, in world axes.
    let up = found.attitude * (truth.body_from_world * Vector3::z());
    errors.fixed_rows_mut::<3>(error_state::ATTITUDE).copy_from(&-Vector3::z().cross(&up));
    errors.fixed_rows_mut::<3>(error_state::GYRO_BIAS).copy_from(&(truth.biases[0] - found.gyro_bias));
    errors.fixed_rows_mut::<3>(error_state::ACCEL_BIAS).copy_from(&(truth.biases[1] - found.accel_bias));
    errors
}

const BIASES: [Vector3<f64>; 2] = [Vector3::new(0.02, -0.01, 0.015), Vector3::new(0.05, -0.04, 0.03)];

#[test]
fn exact_directions_give_the_exact_motion() {
    let mut started = 0;
    for seed in 0..10 {
        let (found, truth) = window((0.5, 0.5), [BIASES[0], Vector3::zeros()], (0.0, 0.0), Mistaken::None, seed);
        let Some(found) = converged(found) else { continue };
        started += 1;
        let off = errors(&found, &truth);
        assert!(off.fixed_rows::<3>(error_state::VELOCITY).norm() < 5e-3, "{seed}: {off}");
        assert!(off.fixed_rows::<3>(error_state::ATTITUDE).norm() < 2e-3, "{seed}: {off}");
        assert!(off.fixed_rows::<3>(error_state::GYRO_BIAS).norm() < 2e-3, "{seed}: {off}");
        for depth in &found.landmarks {
            let distance = truth.distances[depth.point];
            assert!((depth.inverse_distance * distance - 1.0).abs() < 0.01, "{seed}: {depth:?} {distance}");
        }
    }
    assert!(started >= 9, "{started} of 10");
}

#[test]
fn noise_is_within_what_is_claimed() {
    claims(0.4, 0.0, 54);
}

/// An accelerometer ten times as noisy as that of EuRoC.
#[test]
fn noise_of_the_samples_is_within_what_is_claimed() {
    claims(0.4, 0.02, 54);
}

/// An accelerometer that vibrates as flying ones do, in gentle motion. Waiting does not help: of a longer window it tells less.
#[test]
fn noise_of_the_samples_keeps_nothing_from_starting() {
    claims(0.05, 0.02, 54);
}

fn claims(agility: f64, accel_density: f64, least: usize) {
    let (mut started, mut squares) = (0, [0.0; 4]);
    for seed in 0..60 {
        let (found, truth) = window((0.5, agility), BIASES, (0.3, accel_density), Mistaken::None, seed);
        let Some(found) = converged(found) else { continue };
        started += 1;
        let covariance = found.core * found.covariance * found.core.transpose();
        let off = errors(&found, &truth);
        let scale = off.fixed_rows::<3>(error_state::VELOCITY).norm() / truth.velocity.norm();
        assert!(scale < 0.25, "{seed}: {scale}");
        let square = |row: usize, count: usize| {
            let block: nalgebra::DMatrix<f64> = covariance.view((row, row), (count, count)).into_owned();
            let off: nalgebra::DVector<f64> = off.rows(row, count).into_owned();
            off.dot(&block.cholesky().unwrap().solve(&off)) / count as f64
        };
        for (sum, (row, count)) in squares.iter_mut().zip([
            (error_state::VELOCITY, 3),
            (error_state::ATTITUDE, 2),
            (error_state::GYRO_BIAS, 3),
            (error_state::ACCEL_BIAS, 3),
        ]) {
            *sum += square(row, count);
        }
    }
    assert!(started >= least, "{started} of 60");
    let mean = squares.map(|sum| sum / started as f64);
    eprintln!("{started} of 60, squared errors in units of the claim {mean:.2?}");
    assert!(mean.iter().all(|m| *m < 2.0), "{mean:?}");
}

#[test]
fn points_that_move_are_left_out() {
    for seed in 0..10 {
        let (found, truth) = window((0.5, 0.5), BIASES, (0.3, 0.0), Mistaken::Drawn(3), seed);
        let Some(found) = converged(found) else { continue };
        let off = errors(&found, &truth);
        let off = off.fixed_rows::<3>(error_state::VELOCITY).norm();
        assert!(off < 0.15 * truth.velocity.norm(), "{seed}: {off}");
        assert!(found.landmarks.iter().all(|depth| depth.point >= 3), "{seed}");
    }
}

#[test]
fn straight_flight_at_constant_speed_is_refused() {
    // Turning, but without acceleration: any scale explains what is seen.
    for (speed, seed) in (0..20).flat_map(|seed| [(0.5, seed), (0.1, seed), (2.0, seed)]) {
        let (found, _) = window((speed, 0.0), [Vector3::zeros(); 2], (0.3, 0.0), Mistaken::None, seed);
        assert!(converged(found).is_none(), "{speed} m/s, {seed}");
    }
}

/// What cannot be seen as it is holds up the refinement at the end of the range of distances, until it is left out.
#[test]
fn points_that_hold_up_all_are_left_out() {
    for seed in [1, 2, 11] {
        let (found, truth) = window((0.5, 0.5), BIASES, (0.3, 0.0), Mistaken::Mirrored(3, 1.0), seed);
        let found = converged(found).unwrap_or_else(|| panic!("{seed}: not started"));
        let off = errors(&found, &truth).fixed_rows::<3>(error_state::VELOCITY).norm();
        assert!(off < 0.05 * truth.velocity.norm(), "{seed}: {off}");
        assert!(found.landmarks.iter().all(|depth| depth.point >= 3), "{seed}");
    }
}

/// Points too far to be told from the others, and too many: where the refinement ends is no minimum, and its covariance claims nothing.
#[test]
fn no_start_without_a_minimum() {
    for (agility, farther, seed) in [(0.2, 80.0, 11), (0.2, 320.0, 6), (0.5, 320.0, 11)] {
        let (found, _) = window((0.5, agility), BIASES, (0.3, 0.0), Mistaken::Mirrored(10, farther), seed);
        assert!(converged(found).is_none(), "{seed}");
    }
}

/// As slow as a hover the scale is not known for long: the velocity is.
#[test]
fn a_hover_starts_without_the_scale() {
    let (mut started, mut unknown, mut square) = (0, 0, 0.0);
    for seed in 0..20 {
        let (found, truth) = window((0.01, 0.002), BIASES, (0.3, 0.0), Mistaken::None, seed);
        let Some(found) = converged(found) else { continue };
        started += 1;
        unknown += u32::from(found.scale_sigma > 0.05);
        let off = errors(&found, &truth).fixed_rows::<3>(error_state::VELOCITY).into_owned();
        let covariance = found.core * found.covariance * found.core.transpose();
        let block = covariance.fixed_view::<3, 3>(error_state::VELOCITY, error_state::VELOCITY).into_owned();
        square += off.dot(&block.cholesky().unwrap().solve(&off)) / 3.0;
    }
    let square = square / f64::from(started);
    assert!(started >= 15 && unknown >= 10 && square < 2.0, "{started} of 20, {unknown} without a scale, {square}");
}
