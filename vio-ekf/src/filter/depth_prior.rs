//! The shared depth prior: landmarks of one scene are about as far away as each other, and how far is itself estimated.

use super::settings::LandmarkSettings;
use super::state::error_state;
use super::state::inverse_distance::InverseDistance;
use super::state::vio_state::VioState;
use crate::inertial::covariance::Covariance;

/// Lets the prior walk: the camera comes to see another scene.
pub(crate) fn propagate(state: &VioState, covariance: &mut Covariance, settings: &LandmarkSettings, elapsed: f64) {
    let walk = settings.shared_walk * state.depth_prior.value;
    covariance.inflate(error_state::DEPTH_PRIOR, walk * walk * elapsed);
}

/// Sets the prior to the mean of the landmarks that there are, with what it has in common with them.
pub(crate) fn reset_to_mean(state: &mut VioState, covariance: &mut Covariance, settings: &LandmarkSettings) {
    let count = state.landmarks.len();
    if count == 0 {
        return;
    }
    let share = 1.0 / count as f64;
    let mean = state.landmarks.iter().map(|landmark| landmark.inverse_distance.value * share).sum::<f64>();
    state.depth_prior = InverseDistance::new(mean);
    covariance.reset_row(error_state::DEPTH_PRIOR, 0.0);
    for slot in 0..count {
        covariance.add_row(error_state::DEPTH_PRIOR, share, state.landmark_row(slot) + 2);
    }
    covariance.inflate(error_state::DEPTH_PRIOR, settings.own_variance(mean) * share);
}

/// Rescales the covariance of inverse distances that have become smaller: the errors of what is far away are relative to it.
pub(crate) fn rescale_covariance(state: &mut VioState, covariance: &mut Covariance) {
    let head = state.head();
    let landmarks = state.landmarks.iter_mut().map(|landmark| &mut landmark.inverse_distance).enumerate();
    for (row, distance) in landmarks
        .map(|(slot, distance)| (error_state::landmark(head, slot) + 2, distance))
        .chain([(error_state::DEPTH_PRIOR, &mut state.depth_prior)])
    {
        let factor = distance.take_scale_factor();
        if factor < 1.0 {
            covariance.scale(row, factor);
        }
    }
}
