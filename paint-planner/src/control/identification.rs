//! Gain, lag and delay of the attitude loop from a recorded excitation (Paper II, section 5.2).

use nalgebra::{DMatrix, Matrix3, Matrix4};

use super::attitude_sample::AttitudeSample;
use super::output_error::{OutputError, Solution};
use super::response::{first_order, second_order};
use super::vehicle::AttitudeResponse;
use crate::error::Error;

/// What a recording tells about one angle.
#[derive(Debug, Clone, PartialEq)]
pub struct AttitudeFit {
    /// Gain and time constant.
    pub response: AttitudeResponse,
    /// Time from a command to the start of its effect, s.
    pub delay: f64,
    /// Angle that is held when zero is commanded, rad.
    pub offset: f64,
    /// Covariance of gain, time constant and delay, for errors of the measured angle that are independent and alike.
    pub covariance: Matrix3<f64>,
    /// RMS of what the fit leaves, rad.
    pub residual: f64,
    /// RMS of the measured angle about its mean, rad: what there was to explain.
    pub signal: f64,
}

/// How one angle follows its command: `x'' = w² (K u - x) - 2 d w x'`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SecondOrderResponse {
    /// Gain `K`.
    pub gain: f64,
    /// Natural frequency `w`, rad/s.
    pub natural_frequency: f64,
    /// Damping ratio `d`.
    pub damping: f64,
}

/// What a recording tells about one angle of second order.
#[derive(Debug, Clone, PartialEq)]
pub struct SecondOrderFit {
    /// Gain, natural frequency and damping.
    pub response: SecondOrderResponse,
    /// Time from a command to the start of its effect, s.
    pub delay: f64,
    /// Angle that is held when zero is commanded, rad.
    pub offset: f64,
    /// Covariance of gain, natural frequency, damping and delay, for errors of the measured angle that are independent and alike.
    pub covariance: Matrix4<f64>,
    /// RMS of what the fit leaves, rad.
    pub residual: f64,
    /// RMS of the measured angle about its mean, rad.
    pub signal: f64,
}

/// Fewest samples.
const LEAST_SAMPLES: usize = 50;
/// Numbers that are tried first: delays and time constants, s; natural frequencies, rad/s; damping ratios.
const DELAYS: [f64; 7] = [0.0, 0.02, 0.04, 0.08, 0.12, 0.2, 0.3];
const TIME_CONSTANTS: [f64; 6] = [0.03, 0.06, 0.12, 0.25, 0.5, 1.0];
const FREQUENCIES: [f64; 5] = [2.0, 4.0, 8.0, 16.0, 32.0];
const DAMPINGS: [f64; 3] = [0.4, 0.8, 1.6];
/// Shortest time constant, s, and least natural frequency, rad/s, and damping.
const SHORTEST: f64 = 1e-3;
const LEAST: f64 = 1e-2;
/// Largest share of the variance of what was measured that a fit may leave: a coherence of 0.8. And of the recording that lag and delay
/// may last.
const MOST_LEFT: f64 = 0.2;
const MOST_LAG: f64 = 0.2;
/// A number is known when its standard deviation is at most this share of it.
const MOST_UNCERTAIN: f64 = 0.1;

/// Fits `tau x' = K u(t - delay) - x` to a recording, with an unknown offset and state at its beginning.
///
/// Errors of the output are minimised, not those of an equation between successive samples: noise of the measured angle then
/// biases nothing.
///
/// # Errors
/// Fewer than 50 samples, times that do not rise, numbers that are not finite, a command that never changes or does not excite what is
/// asked for, or an angle that does not follow it.
pub fn identify_attitude(samples: &[AttitudeSample]) -> Result<AttitudeFit, Error> {
    check(samples)?;
    let columns = |others| first_order(samples, others);
    let starts = DELAYS.iter().flat_map(|&delay| TIME_CONSTANTS.iter().map(move |&tau| [tau, delay]));
    let fitted = OutputError { measured: measured(samples), columns: &columns, linear: 3, least: [SHORTEST, 0.0] };
    let Solution { linear: [gain, offset, ..], others: [time_constant, delay], error, covariance } =
        fitted.solve(starts)?;
    let (residual, signal) = left(samples, error, time_constant + delay)?;
    let covariance = Matrix3::from_fn(|i, j| covariance[([0, 3, 4][i], [0, 3, 4][j])]);
    known([(gain, covariance[(0, 0)]), (time_constant, covariance[(1, 1)])])?;
    let response = AttitudeResponse { gain, time_constant };
    Ok(AttitudeFit { response, delay, offset, covariance, residual, signal })
}

/// Fits `x'' = w² (K u(t - delay) - x) - 2 d w x'` to a recording, as [`identify_attitude`] does the first order.
///
/// # Errors
/// As [`identify_attitude`]; an angle that follows in the first order tells no natural frequency.
pub fn identify_second_order(samples: &[AttitudeSample]) -> Result<SecondOrderFit, Error> {
    check(samples)?;
    let columns = |others| second_order(samples, others);
    let starts = DELAYS.iter().step_by(2).flat_map(|&delay| {
        FREQUENCIES.iter().flat_map(move |&frequency| DAMPINGS.iter().map(move |&damping| [frequency, damping, delay]))
    });
    let fitted = OutputError { measured: measured(samples), columns: &columns, linear: 4, least: [LEAST, LEAST, 0.0] };
    let Solution { linear: [gain, offset, ..], others, error, covariance } = fitted.solve(starts)?;
    let [natural_frequency, damping, delay] = others;
    let (residual, signal) = left(samples, error, 2.0 * damping / natural_frequency + delay)?;
    let covariance = picked(&covariance);
    known([(gain, covariance[(0, 0)]), (natural_frequency, covariance[(1, 1)]), (damping, covariance[(2, 2)])])?;
    let response = SecondOrderResponse { gain, natural_frequency, damping };
    Ok(SecondOrderFit { response, delay, offset, covariance, residual, signal })
}

/// Of gain, natural frequency, damping and delay.
fn picked(covariance: &DMatrix<f64>) -> Matrix4<f64> {
    Matrix4::from_fn(|i, j| covariance[([0, 4, 5, 6][i], [0, 4, 5, 6][j])])
}

fn measured(samples: &[AttitudeSample]) -> Vec<f64> {
    samples.iter().map(|sample| sample.measured).collect()
}

/// RMS of what a fit leaves, and of what there was to explain; `lag`: how late the angle is, s.
fn left(samples: &[AttitudeSample], error: f64, lag: f64) -> Result<(f64, f64), Error> {
    let count = samples.len() as f64;
    let mean = samples.iter().map(|s| s.measured).sum::<f64>() / count;
    let signal = samples.iter().map(|s| (s.measured - mean).powi(2)).sum::<f64>() / count;
    let recorded = samples[samples.len() - 1].time - samples[0].time;
    if error / count > MOST_LEFT * signal || lag > MOST_LAG * recorded {
        return Err(Error::Recording { what: "what was measured does not follow the command" });
    }
    Ok(((error / count).sqrt(), signal.sqrt()))
}

/// Whether numbers are known, by their variances.
fn known<const N: usize>(numbers: [(f64, f64); N]) -> Result<(), Error> {
    // A variance that is not a number is no knowledge.
    let known = numbers.iter().all(|(value, variance)| variance.sqrt() <= MOST_UNCERTAIN * value.abs());
    if known { Ok(()) } else { Err(Error::Recording { what: "the excitation is too weak to tell gain and lag" }) }
}

fn check(samples: &[AttitudeSample]) -> Result<(), Error> {
    if samples.len() < LEAST_SAMPLES {
        return Err(Error::Recording { what: "it has fewer than 50 samples" });
    }
    if !samples.iter().all(|s| s.time.is_finite() && s.commanded.is_finite() && s.measured.is_finite()) {
        return Err(Error::Recording { what: "it holds a number that is not finite" });
    }
    if samples.windows(2).any(|pair| pair[1].time <= pair[0].time) {
        return Err(Error::Recording { what: "its times do not rise" });
    }
    let first = samples[0].commanded;
    if samples.iter().all(|s| (s.commanded - first).abs() < 1e-9) {
        return Err(Error::Recording { what: "its command never changes" });
    }
    Ok(())
}
