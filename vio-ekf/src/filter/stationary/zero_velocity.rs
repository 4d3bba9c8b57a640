//! Propagation and covariance of a stationary body.

use nalgebra::Vector3;

use crate::filter::estimator::Estimator;
use crate::filter::settings::StationarySettings;
use crate::filter::state::error_state;
use crate::stamp::Stamp;

/// Propagates to a time without any motion: what the samples read is then bias and gravity. The state stays behind by the delay of
/// the settings: should the body turn out to have set off meanwhile, the buffered samples tell how.
pub(crate) fn zero_velocity_propagate(estimator: &mut Estimator, now: Stamp, settings: &StationarySettings) {
    let until = now.plus_secs(-settings.delay_s).max(estimator.buffer.half_free()).max(estimator.buffer.state_stamp());
    let elapsed = until.secs_since(estimator.buffer.state_stamp());
    let walks =
        [(error_state::GYRO_BIAS, estimator.noise.gyro_walk), (error_state::ACCEL_BIAS, estimator.noise.accel_walk)];
    for (row, walk) in walks.into_iter().flat_map(|(row, walk)| (row..row + 3).map(move |row| (row, walk))) {
        estimator.covariance.inflate(row, walk * walk * elapsed);
    }
    estimator.buffer.advance(until);
    // A reset, no Kalman update: nothing moves, whatever the correlations with other errors say about the velocity.
    estimator.state.core.velocity = Vector3::zeros();
    for row in error_state::VELOCITY..error_state::VELOCITY + 3 {
        estimator.covariance.reset_row(row, settings.velocity_sigma * settings.velocity_sigma);
    }
    estimator.rate = Vector3::zeros();
}

/// Inflates the pose by a small motion, an angle, that was not detected before the body was found to be stationary.
pub(crate) fn inflate_undetected_motion(estimator: &mut Estimator, angle: f64) {
    let variance = angle * angle;
    estimator.inflate_bearings(|_| variance);
    for axis in 0..3 {
        estimator.covariance.inflate(error_state::ATTITUDE + axis, variance);
        let position_variance = variance / estimator.state.depth_prior.value.powi(2);
        estimator.covariance.inflate(error_state::POSITION + axis, position_variance);
    }
}
