//! What an excitation flight told about the vehicle.

use paint_planner::control::{AttitudeFit, IdentifiedAttitude};
use paint_sim::flight::Airframe;
use serde::Serialize;

/// Gains and lags of roll and pitch with their standard deviations.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct IdentifiedFigures {
    /// Gain of roll.
    pub identified_roll_gain: f64,
    /// Its standard deviation.
    pub identified_roll_gain_sigma: f64,
    /// Time constant of roll.
    pub identified_roll_time_constant_s: f64,
    /// Its standard deviation.
    pub identified_roll_time_constant_sigma_s: f64,
    /// Time from a command of roll to the start of its effect.
    pub identified_roll_delay_s: f64,
    /// Gain of pitch.
    pub identified_pitch_gain: f64,
    /// Its standard deviation.
    pub identified_pitch_gain_sigma: f64,
    /// Time constant of pitch.
    pub identified_pitch_time_constant_s: f64,
    /// Its standard deviation.
    pub identified_pitch_time_constant_sigma_s: f64,
    /// Time from a command of pitch to the start of its effect.
    pub identified_pitch_delay_s: f64,
    /// Largest error of gains and lags against the simulated vehicle, as a share of its.
    pub identified_error_share: f64,
}

impl IdentifiedFigures {
    /// What was learnt, and the model made of it, beside the vehicle itself.
    pub fn of(model: &Airframe, told: &IdentifiedAttitude, truth: &Airframe) -> Self {
        let [roll, pitch] = &told.first_order;
        let sigma = |fit: &AttitudeFit, k: usize| fit.covariance[(k, k)].sqrt();
        let shares = [
            model.roll_gain / truth.roll_gain,
            model.roll_time_constant / truth.roll_time_constant,
            model.pitch_gain / truth.pitch_gain,
            model.pitch_time_constant / truth.pitch_time_constant,
        ];
        Self {
            identified_roll_gain: roll.response.gain,
            identified_roll_gain_sigma: sigma(roll, 0),
            identified_roll_time_constant_s: roll.response.time_constant,
            identified_roll_time_constant_sigma_s: sigma(roll, 1),
            identified_roll_delay_s: roll.delay,
            identified_pitch_gain: pitch.response.gain,
            identified_pitch_gain_sigma: sigma(pitch, 0),
            identified_pitch_time_constant_s: pitch.response.time_constant,
            identified_pitch_time_constant_sigma_s: sigma(pitch, 1),
            identified_pitch_delay_s: pitch.delay,
            identified_error_share: shares.map(|share| (share - 1.0).abs()).into_iter().fold(0.0, f64::max),
        }
    }
}
