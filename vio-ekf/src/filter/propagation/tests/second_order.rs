//! Mean and covariance of the second-order terms against random draws.

use nalgebra::{DMatrix, DVector, SMatrix, SVector, UnitQuaternion, Vector3};

use super::support::{GRAVITY, difference, filled, integrate, model, readings, state, transition};
use crate::filter::propagation::propagate::{Workspace, propagate};
use crate::filter::propagation::second_order_terms::MIN_CORRELATION_S;
use crate::filter::state::error_state;
use crate::filter::state::inverse_distance::InverseDistance;
use crate::samples::ImuNoise;
use crate::sim::Rng;
use crate::test_random::signed;

#[test]
fn products_of_errors_are_accounted_for() {
    // Two landmarks whose distances are hardly known, and wrong together, seen from a camera whose velocity is hardly known, and wrong
    // in a way that has to do with the distances: mean and spread of the bearings by drawing states and moving them.
    let mut rng = Rng::new(8);
    let mut state = state(&mut rng, 2);
    (state.core.velocity, state.camera_attitude) = (Vector3::new(0.4, -0.3, 0.5), UnitQuaternion::identity());
    state.landmarks.iter_mut().for_each(|landmark| landmark.inverse_distance = InverseDistance::new(0.6));
    let readings = readings(&mut rng, 10);
    let n = error_state::landmark(error_state::FIXED, 2);
    let rows = [
        error_state::VELOCITY,
        error_state::VELOCITY + 1,
        error_state::VELOCITY + 2,
        error_state::landmark(error_state::FIXED, 0) + 2,
        error_state::landmark(error_state::FIXED, 1) + 2,
    ];
    // Each error by five independent ones.
    let mix = SMatrix::<f64, 5, 5>::new(
        0.5, 0.0, 0.0, 0.0, 0.0, //
        0.0, 0.6, 0.0, 0.0, 0.0, //
        0.0, 0.0, 0.5, 0.0, 0.0, //
        -0.05, 0.05, -0.06, 0.09, 0.0, //
        -0.05, 0.05, -0.06, 0.06, 0.06,
    );
    let mut prior = DMatrix::zeros(n, n);
    let among = mix * mix.transpose();
    for r in 0..5 {
        for c in 0..5 {
            prior[(rows[r], rows[c])] = among[(r, c)];
        }
    }
    let bearings = |d: &DVector<f64>| {
        let [a, b] = [error_state::landmark(error_state::FIXED, 0), error_state::landmark(error_state::FIXED, 1)];
        SVector::<f64, 4>::new(d[a], d[a + 1], d[b], d[b + 1])
    };
    let mut normal = || (0..12).map(|_| signed(&mut rng)).sum::<f64>() / 2.0;
    let middle = model(&readings, &state);
    let count = 40_000;
    let (mut mean, mut square) = (SVector::<f64, 4>::zeros(), SMatrix::<f64, 4, 4>::zeros());
    for _ in 0..count {
        let drawn = mix * SVector::<f64, 5>::from_fn(|_, _| normal());
        let mut delta = vec![0.0; n];
        (0..5).for_each(|k| delta[rows[k]] = drawn[k]);
        let mut moved = state.clone();
        moved.correct(&delta);
        let d = bearings(&difference(&model(&readings, &moved), &middle));
        mean += d / f64::from(count);
        square += d * d.transpose() / f64::from(count);
    }
    let spread = square - mean * mean.transpose();

    let mut covariance = filled(&prior);
    let preintegration = integrate(&readings, &state, &ImuNoise::ZERO);
    let mut end = state.clone();
    propagate(&mut end, &mut covariance, (&preintegration, GRAVITY), &mut Workspace::new(n, 4), |_| panic!("lost"));
    let f = transition(&readings, &state);
    let linear = &f * &prior * f.transpose();
    let block = |of: &dyn Fn(usize, usize) -> f64| {
        let at = |k: usize| error_state::landmark(error_state::FIXED, k / 2) + k % 2;
        SMatrix::<f64, 4, 4>::from_fn(|r, c| of(at(r), at(c)))
    };
    let linear = block(&|r, c| linear[(r, c)]);
    // Counted for as many steps as it lasts; nothing is known here of the position.
    let products =
        (block(&|r, c| covariance.row(r)[c]) - linear) / (1.0 + 2.0 * MIN_CORRELATION_S / preintegration.duration);
    let expected = spread - linear;
    assert!(expected.norm() > 0.03 * linear.norm(), "{expected} {linear}");
    assert!((products - expected).norm() < 0.25 * expected.norm(), "{products} {expected}");
    let shift = bearings(&difference(&end, &middle));
    assert!((shift - mean).norm() < 0.2 * mean.norm(), "{shift} {mean}");
}
