//! Transition, noise and gauge freedom of the propagation.

use nalgebra::{DMatrix, Matrix3, Vector3};

use super::support::{
    GRAVITY, dense, difference, filled, integrate, model, random_covariance, readings, state, transition,
};
use crate::camera::Camera;
use crate::filter::propagation::propagate::{Workspace, propagate};
use crate::filter::state::error_state;
use crate::inertial::covariance::Covariance;
use crate::samples::ImuNoise;
use crate::sim::Rng;
use crate::test_random::{signed, vector};

const SMALL: f64 = 1e-13;

#[test]
fn covariance_moves_with_the_transition_of_the_whole_state() {
    let mut rng = Rng::new(1);
    for seed in 0..6 {
        let (mut state, readings) = (state(&mut rng, 4), readings(&mut rng, 10));
        if seed % 2 == 1 {
            state.lens = Some(Camera::euroc());
            state.gyro_scale = vector(&mut rng) * 0.05 + Vector3::repeat(1.0);
        }
        state.accel_matrix = Some(Matrix3::identity() + Matrix3::from_fn(|_, _| 0.05 * signed(&mut rng)));
        let f = transition(&readings, &state);
        // Small, so that the products of errors, which are quadratic in it, do not show.
        let prior = random_covariance(&mut rng, f.nrows()) * SMALL;
        let mut covariance = filled(&prior);
        let mut end = state.clone();
        let preintegration = integrate(&readings, &state, &ImuNoise::ZERO);
        propagate(&mut end, &mut covariance, (&preintegration, GRAVITY), &mut Workspace::new(f.nrows(), 4), |_| {
            panic!("lost")
        });
        let error = dense(&covariance) - &f * &prior * f.transpose();
        // The bias columns drop terms of the order of rate · dt · dt / 12 per step.
        assert!(error.amax() < 2e-4 * SMALL, "{}", error.amax());
        // Without errors of biases and of the gyroscope's scales nothing is dropped: only the truncation of the differences is left.
        let mut exact = prior.clone();
        let scales = if state.lens.is_some() { error_state::GYRO_SCALE..error_state::SECOND_INTRINSICS } else { 0..0 };
        for k in (error_state::GYRO_BIAS..error_state::CORE).chain(scales) {
            exact.row_mut(k).fill(0.0);
            exact.column_mut(k).fill(0.0);
        }
        let mut covariance = filled(&exact);
        propagate(
            &mut state.clone(),
            &mut covariance,
            (&preintegration, GRAVITY),
            &mut Workspace::new(f.nrows(), 4),
            |_| panic!("lost"),
        );
        let error = dense(&covariance) - &f * &exact * f.transpose();
        assert!(error.amax() < 2e-7 * SMALL, "{}", error.amax());
    }
}

#[test]
fn noise_is_the_sum_over_the_samples() {
    // N = Σ over samples of the response to a disturbance of that sample: white noise of the sample itself, and a step
    // of the bias that all later samples see.
    let mut rng = Rng::new(2);
    let (state, readings) = (state(&mut rng, 3), readings(&mut rng, 12));
    let noise = ImuNoise { gyro_density: 0.01, gyro_walk: 0.02, accel_density: 0.03, accel_walk: 0.5 };
    let n = error_state::landmark(error_state::FIXED, 3);
    let mut expected = DMatrix::<f64>::zeros(n, n);
    let (h, dt) = (1e-4, 0.005);
    for first in 0..readings.len() {
        for axis in 0..6 {
            for walking in [false, true] {
                let moved = [h, -h].map(|h| {
                    let mut disturbed = readings.clone();
                    // A walk of the bias during a step acts from the next one on.
                    let range = if walking { first + 1..readings.len() } else { first..first + 1 };
                    for reading in &mut disturbed[range] {
                        reading[axis / 3][axis % 3] += h;
                    }
                    let mut end = model(&disturbed, &state);
                    if walking {
                        let bias = if axis < 3 { &mut end.core.gyro_bias } else { &mut end.core.accel_bias };
                        // The reading that is higher by h than assumed means a motion that is lower by h: a bias of −h
                        // undetected. The signs cancel between bias and motion only if both are told.
                        bias[axis % 3] -= h;
                    }
                    end
                });
                let response = difference(&moved[0], &moved[1]) / (2.0 * h);
                let (white, walk) = if axis < 3 {
                    (noise.gyro_density, noise.gyro_walk)
                } else {
                    (noise.accel_density, noise.accel_walk)
                };
                let variance = if walking { walk * walk * dt } else { white * white / dt };
                expected += &response * response.transpose() * variance;
            }
        }
    }
    let mut covariance = Covariance::new(n, n);
    let preintegration = integrate(&readings, &state, &noise);
    propagate(&mut state.clone(), &mut covariance, (&preintegration, GRAVITY), &mut Workspace::new(n, 4), |_| {
        panic!("lost")
    });
    let ours = dense(&covariance);
    for row in 0..n {
        for column in 0..n {
            let scale = (expected[(row, row)] * expected[(column, column)]).sqrt();
            let error = (ours[(row, column)] - expected[(row, column)]).abs();
            // Differences of a constant are not exactly zero.
            assert!(error <= 2e-3 * scale + 1e-13, "({row}, {column}): {error} of {scale}");
        }
    }
}

#[test]
fn position_and_yaw_never_reach_what_the_camera_sees() {
    // Shifting the world and turning it about the vertical moves no landmark, at any state: the four columns of the
    // transition stay in the span of the same four directions.
    let mut rng = Rng::new(3);
    for _ in 0..20 {
        let (state, readings) = (state(&mut rng, 3), readings(&mut rng, 10));
        let n = error_state::landmark(error_state::FIXED, 3);
        for direction in 0..4 {
            let row = [
                error_state::POSITION,
                error_state::POSITION + 1,
                error_state::POSITION + 2,
                error_state::ATTITUDE + 2,
            ][direction];
            let mut prior = DMatrix::zeros(n, n);
            prior[(row, row)] = 1.0;
            let mut covariance = filled(&prior);
            let preintegration = integrate(&readings, &state, &ImuNoise::ZERO);
            propagate(
                &mut state.clone(),
                &mut covariance,
                (&preintegration, GRAVITY),
                &mut Workspace::new(n, 4),
                |_| panic!("lost"),
            );
            for k in (error_state::VELOCITY..n).filter(|&k| k != error_state::ATTITUDE + 2) {
                assert!(covariance.variance(k) == 0.0, "row {k} depends on gauge direction {direction}");
            }
            assert!((covariance.variance(row) - 1.0).abs() < 1e-15);
        }
    }
}
