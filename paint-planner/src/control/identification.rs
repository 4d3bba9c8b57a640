//! Gain, time constant and delay of the attitude loop from a recorded excitation (Paper II, section 5.2).

use nalgebra::{Matrix3, Matrix5, SMatrix, SVector, Vector3};

use super::vehicle::AttitudeResponse;
use crate::error::Error;

/// One line of a recording.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AttitudeSample {
    /// Time, s.
    pub time: f64,
    /// Angle commanded from here until the next sample, rad.
    pub commanded: f64,
    /// Angle measured here, rad.
    pub measured: f64,
}

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

/// Fewest samples.
const LEAST_SAMPLES: usize = 50;
/// Delays and time constants that are tried first, s.
const DELAYS: [f64; 7] = [0.0, 0.02, 0.04, 0.08, 0.12, 0.2, 0.3];
const TIME_CONSTANTS: [f64; 6] = [0.03, 0.06, 0.12, 0.25, 0.5, 1.0];
/// Steps of the least-squares iteration, and the share of its error below which it has settled.
const STEPS: usize = 60;
const SETTLED: f64 = 1e-12;
/// Differences of time constant and delay for the slopes, s.
const NUDGE: f64 = 1e-5;
/// Shortest time constant, s.
const SHORTEST: f64 = 1e-3;
/// Largest share of the measured deviation that a fit may leave, and of the recording that lag and delay may last.
const MOST_LEFT: f64 = 0.7;
const MOST_LAG: f64 = 0.2;

/// Fits `tau x' = K u(t - delay) - x` to a recording, with an unknown offset and state at its beginning.
///
/// Errors of the output are minimised, not those of an equation between successive samples: noise of the measured angle then
/// biases nothing. For given time constant and delay the rest is linear and solved exactly (variable projection, Golub and Pereyra
/// 1973), so the search is over two numbers, from a grid, by Levenberg's and Marquardt's method.
///
/// # Errors
/// Fewer than 50 samples, times that do not rise, numbers that are not finite, a command that never changes, or an angle that does not
/// follow it.
pub fn identify_attitude(samples: &[AttitudeSample]) -> Result<AttitudeFit, Error> {
    check(samples)?;
    let start = DELAYS
        .iter()
        .flat_map(|&delay| TIME_CONSTANTS.iter().map(move |&tau| [tau, delay]))
        .map(|guess| (project(samples, guess).error, guess))
        .min_by(|a, b| a.0.total_cmp(&b.0));
    let Some((mut error, mut guess)) = start else { return Err(Error::Recording { what: "no sample" }) };
    let mut damping = 1e-3;
    for _ in 0..STEPS {
        let (hessian, gradient) = normal_equations(samples, guess);
        // Only time constant and delay are free here; the linear part follows them.
        let mut damped = hessian;
        for k in 0..5 {
            damped[(k, k)] *= 1.0 + damping;
        }
        let Some(step) = damped.cholesky().map(|c| c.solve(&gradient)) else { break };
        let next = [(guess[0] + step[3]).max(SHORTEST), (guess[1] + step[4]).max(0.0)];
        let reached = project(samples, next).error;
        if reached <= error {
            let gained = error - reached;
            (error, guess) = (reached, next);
            damping *= 0.3;
            if gained <= SETTLED * error {
                break;
            }
        } else {
            damping *= 10.0;
            if damping > 1e12 {
                break;
            }
        }
    }
    let [gain, offset, _] = project(samples, guess).linear.into();
    let (hessian, _) = normal_equations(samples, guess);
    let count = samples.len() as f64;
    let variance = error / (count - 5.0);
    let covariance = hessian
        .try_inverse()
        .ok_or(Error::Recording { what: "the excitation does not tell gain, lag and delay apart" })?;
    let pick = [0, 3, 4];
    let mean = samples.iter().map(|s| s.measured).sum::<f64>() / count;
    let signal = (samples.iter().map(|s| (s.measured - mean).powi(2)).sum::<f64>() / count).sqrt();
    let residual = (error / count).sqrt();
    let recorded = samples[samples.len() - 1].time - samples[0].time;
    if residual > MOST_LEFT * signal || guess[0] + guess[1] > MOST_LAG * recorded {
        return Err(Error::Recording { what: "what was measured does not follow the command" });
    }
    Ok(AttitudeFit {
        response: AttitudeResponse { gain, time_constant: guess[0] },
        delay: guess[1],
        offset,
        covariance: Matrix3::from_fn(|i, j| variance * covariance[(pick[i], pick[j])]),
        residual,
        signal,
    })
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

/// The best linear part for a time constant and a delay.
struct Projected {
    /// Gain, offset, and state at the beginning.
    linear: Vector3<f64>,
    error: f64,
}

/// What a first-order system of gain 1 shows at each sample, at rest before the first, and the decay of its beginning.
fn responses(samples: &[AttitudeSample], [tau, delay]: [f64; 2]) -> Vec<[f64; 2]> {
    let begin = samples[0].time;
    let mut state = samples[0].commanded;
    let mut now = begin;
    // The command that is in effect, and the next that will be.
    let mut at = 0;
    samples
        .iter()
        .map(|sample| {
            while at + 1 < samples.len() && samples[at + 1].time + delay <= sample.time {
                let change = samples[at + 1].time + delay;
                state = follow(state, samples[at].commanded, change - now, tau);
                (now, at) = (change, at + 1);
            }
            state = follow(state, samples[at].commanded, sample.time - now, tau);
            now = sample.time;
            [state, (-(now - begin) / tau).exp()]
        })
        .collect()
}

fn follow(state: f64, command: f64, time: f64, tau: f64) -> f64 {
    command + (state - command) * (-time / tau).exp()
}

fn project(samples: &[AttitudeSample], guess: [f64; 2]) -> Projected {
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    let shown = responses(samples, guess);
    let row = |[state, decay]: [f64; 2]| Vector3::new(state, 1.0, decay);
    for (sample, shown) in samples.iter().zip(&shown) {
        let row = row(*shown);
        normal += row * row.transpose();
        right += row * sample.measured;
    }
    // A recording whose columns coincide has no unique answer; the grid then prefers another guess.
    let Some(linear) = normal.cholesky().map(|c| c.solve(&right)) else {
        return Projected { linear: Vector3::zeros(), error: f64::INFINITY };
    };
    let error = samples.iter().zip(&shown).map(|(s, shown)| (s.measured - row(*shown).dot(&linear)).powi(2)).sum();
    Projected { linear, error }
}

/// Normal equations of all five parameters: gain, offset, beginning, time constant, delay.
fn normal_equations(samples: &[AttitudeSample], guess: [f64; 2]) -> (Matrix5<f64>, SVector<f64, 5>) {
    let linear = project(samples, guess).linear;
    let value = |[state, decay]: [f64; 2]| linear.x * state + linear.y + linear.z * decay;
    let here = responses(samples, guess);
    let nudged = |tau: f64, delay: f64| responses(samples, [guess[0] + tau, guess[1] + delay]);
    let sides = [[nudged(NUDGE, 0.0), nudged(-NUDGE, 0.0)], [nudged(0.0, NUDGE), nudged(0.0, -NUDGE)]];
    let (mut normal, mut right) = (Matrix5::zeros(), SVector::zeros());
    for (k, sample) in samples.iter().enumerate() {
        let slope = |side: &[Vec<[f64; 2]>; 2]| (value(side[0][k]) - value(side[1][k])) / (2.0 * NUDGE);
        let row = SMatrix::<f64, 1, 5>::new(here[k][0], 1.0, here[k][1], slope(&sides[0]), slope(&sides[1]));
        normal += row.transpose() * row;
        right += row.transpose() * (sample.measured - value(here[k]));
    }
    (normal, right)
}
