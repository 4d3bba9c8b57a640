//! The start in motion on exact and on noisy directions of points.

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};

use super::interval::Interval;
use super::moving::{Motion, MovingSettings, Sighting, solve};
use crate::{ImuNoise, Spline, Stamp, so3};

const FOCAL_LENGTH: f64 = 460.0;
const GRAVITY: f64 = 9.81;

/// A number in `[-1, 1)` from an index: enough randomness for noise.
fn noise(k: usize) -> f64 {
    let z = (k as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    ((z ^ (z >> 27)) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
}

/// A flight with the given strength of its accelerations; the truth at the end of the window in body axes.
fn window(
    agility: f64,
    bias: Vector3<f64>,
    pixel_sigma: f64,
    seed: usize,
) -> (Option<Motion>, Vector3<f64>, Vector3<f64>) {
    let knots = (0..60).map(|k| {
        let t = f64::from(k) * 0.05;
        let sway = |f: f64, p: f64| (f * t + p + seed as f64).sin();
        let position =
            Vector3::new(0.5 * t, 0.0, 0.0) + Vector3::new(sway(2.1, 0.0), sway(2.9, 1.0), sway(2.3, 2.0)) * agility;
        let turn = Vector3::new(0.2 * sway(1.3, 0.5), 0.2 * sway(1.9, 2.5), 0.3 * t);
        Isometry3::from_parts(position.into(), so3::exp(&turn))
    });
    let spline = Spline::new(Stamp::from_nanos(0), 50_000_000, knots.collect()).unwrap();
    let at = |nanos: i64| spline.sample(Stamp::from_nanos(100_000_000 + nanos)).unwrap();
    let camera = (Vector3::new(0.1, -0.05, 0.02), so3::exp(&Vector3::new(0.3, 1.2, -0.4)));
    let body_from_camera = Isometry3::from_parts(camera.0.into(), camera.1);
    let mut intervals = vec![Interval::default()];
    for image in 1..=20 {
        let mut interval = intervals[image - 1].clone();
        for step in 0..10 {
            // Readings in the middle of each step, as the mean of two samples is.
            let m = at((image as i64 - 1) * 50_000_000 + step * 5_000_000 + 2_500_000);
            interval.extend(&(m.rate_in_body + bias), &m.specific_force(GRAVITY), 0.005, &ImuNoise::ZERO);
        }
        intervals.push(interval);
    }
    let camera_pose = |image: usize| at(image as i64 * 50_000_000).world_from_body * body_from_camera;
    let points: Vec<Vec<Sighting>> = (0..20)
        .map(|k| {
            let local = Vector3::new(noise(7 * k + seed), noise(7 * k + 1 + seed), 1.0).normalize()
                * (3.0 + 2.0 * noise(7 * k + 2));
            let point = camera_pose(0) * Point3::from(local);
            (0..=20)
                .map(|image| {
                    let seen = (camera_pose(image).inverse() * point).coords;
                    let jitter = Vector3::from_fn(|i, _| noise(1000 * k + 50 * image + i + seed)) * 1.7;
                    (image, (seen.normalize() + jitter * (pixel_sigma / FOCAL_LENGTH)).normalize())
                })
                .collect()
        })
        .collect();
    let settings = MovingSettings::default();
    let found = solve(&intervals, &points, &camera, FOCAL_LENGTH, GRAVITY, &settings);
    let end = at(1_000_000_000);
    let body_from_world: UnitQuaternion<f64> = end.world_from_body.rotation.inverse();
    (found, body_from_world * end.velocity_in_world, body_from_world * Vector3::new(0.0, 0.0, -GRAVITY))
}

#[test]
fn exact_directions_give_the_exact_motion() {
    let mut started = 0;
    for seed in 0..10 {
        let bias = Vector3::new(0.02, -0.01, 0.015);
        let (found, velocity, gravity) = window(0.3, bias, 0.0, seed);
        // Some of the windows do not accelerate enough for the pixels' assumed noise.
        let Some(found) = found else { continue };
        started += 1;
        assert!((found.velocity - velocity).norm() < 5e-3, "{seed}: {} {velocity}", found.velocity);
        assert!((found.gravity - gravity).norm() < 0.02, "{seed}: {} {gravity}", found.gravity);
        assert!((found.gyro_bias - bias).norm() < 2e-3, "{seed}: {}", found.gyro_bias);
    }
    assert!(started >= 7, "{started} of 10");
}

#[test]
fn noise_is_within_what_is_claimed() {
    let mut started = 0;
    for seed in 0..30 {
        let (found, velocity, gravity) = window(0.3, Vector3::new(0.01, 0.02, -0.02), 0.3, seed);
        let Some(found) = found else { continue };
        started += 1;
        let scale = (found.velocity - velocity).norm() / velocity.norm();
        assert!(scale < 0.15, "{seed}: {scale}");
        assert!((found.velocity - velocity).amax() < 4.0 * found.velocity_sigma, "{seed}");
        let tilt = found.gravity.angle(&gravity);
        assert!(tilt < 4.0 * found.tilt_sigma, "{seed}: {tilt} of {}", found.tilt_sigma);
    }
    assert!(started >= 25, "{started} of 30");
}

#[test]
fn straight_flight_at_constant_speed_is_refused() {
    // Turning, but without acceleration: any scale explains what is seen.
    for seed in 0..10 {
        let (found, ..) = window(0.0, Vector3::zeros(), 0.3, seed);
        assert!(found.is_none(), "{seed}: {found:?}");
    }
}
