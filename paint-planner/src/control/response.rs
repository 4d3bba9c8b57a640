//! What an attitude loop of gain 1 shows for the commands of a recording, which hold from sample to sample and act after a delay.

use super::attitude_sample::AttitudeSample;

/// Most columns of the linear part: response, one, and what a state of two numbers at the beginning leaves.
pub(super) const MOST_COLUMNS: usize = 4;

/// Columns at each sample: the response from rest at the first command, 1, and the decay of the beginning.
pub(super) type Columns = Vec<[f64; MOST_COLUMNS]>;

/// Of `tau x' = u(t - delay) - x`; three columns are used.
pub(super) fn first_order(samples: &[AttitudeSample], [tau, delay]: [f64; 2]) -> Columns {
    let step = |state: &mut [f64; 2], command: f64, time: f64| {
        let decay = (-time / tau).exp();
        *state = [command + (state[0] - command) * decay, state[1] * decay];
    };
    simulate(samples, delay, [samples[0].commanded, 1.0], step)
        .into_iter()
        .map(|[response, decay]| [response, 1.0, decay, 0.0])
        .collect()
}

/// Of `x'' = w² (u(t - delay) - x) - 2 d w x'`; four columns are used.
pub(super) fn second_order(samples: &[AttitudeSample], [frequency, damping, delay]: [f64; 3]) -> Columns {
    let step = |state: &mut [f64; 6], command: f64, time: f64| {
        let transition = transition(frequency, damping, time);
        let after = |[x, rate]: [f64; 2], to: f64| {
            let off = x - to;
            [to + transition[0][0] * off + transition[0][1] * rate, transition[1][0] * off + transition[1][1] * rate]
        };
        let [x, rate, a, b, c, d] = *state;
        let ([x, rate], [a, b], [c, d]) = (after([x, rate], command), after([a, b], 0.0), after([c, d], 0.0));
        *state = [x, rate, a, b, c, d];
    };
    simulate(samples, delay, [samples[0].commanded, 0.0, 1.0, 0.0, 0.0, 1.0], step)
        .into_iter()
        .map(|[response, _, displaced, _, moving, _]| [response, 1.0, displaced, moving])
        .collect()
}

/// `exp(A t)` of angle and rate of the homogeneous second-order system.
fn transition(frequency: f64, damping: f64, time: f64) -> [[f64; 2]; 2] {
    let decay = damping * frequency;
    let square = frequency * frequency * (damping * damping - 1.0);
    let swing = square.abs().sqrt();
    let turned = swing * time;
    // Cosine and sine over the swing, hyperbolic where it is overdamped; together with the decay, as each alone may overflow.
    let (cosine, sine) = if turned < 1e-5 {
        ((-decay * time).exp(), time * (-decay * time).exp())
    } else if square < 0.0 {
        let shrunk = (-decay * time).exp();
        (shrunk * turned.cos(), shrunk * turned.sin() / swing)
    } else {
        let [slow, fast] = [(-(decay - swing) * time).exp(), (-(decay + swing) * time).exp()];
        (0.5 * (slow + fast), 0.5 * (slow - fast) / swing)
    };
    [[cosine + decay * sine, sine], [-frequency * frequency * sine, cosine - decay * sine]]
}

/// The state at each sample; `step` lets a time pass under a command.
fn simulate<const N: usize>(
    samples: &[AttitudeSample],
    delay: f64,
    mut state: [f64; N],
    step: impl Fn(&mut [f64; N], f64, f64),
) -> Vec<[f64; N]> {
    let mut now = samples[0].time;
    // The command that is in effect, and the next that will be.
    let mut at = 0;
    samples
        .iter()
        .map(|sample| {
            while at + 1 < samples.len() && samples[at + 1].time + delay <= sample.time {
                let change = samples[at + 1].time + delay;
                step(&mut state, samples[at].commanded, change - now);
                (now, at) = (change, at + 1);
            }
            step(&mut state, samples[at].commanded, sample.time - now);
            now = sample.time;
            state
        })
        .collect()
}
