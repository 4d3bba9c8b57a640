//! What a flight that excites it, or a recording, tells about the attitude loop.
#![allow(clippy::unwrap_used, reason = "the helpers of the tests are tests as well")]

use nalgebra::{Matrix3, Vector3, Vector4};
use paint_planner::Error;
use paint_planner::control::*;
use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng as _, SeedableRng as _};

fn normal(random: &mut SplitMix64) -> f64 {
    let mut unit = || (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
    let radius = (-2.0 * (1.0 - unit()).ln()).sqrt();
    radius * (std::f64::consts::TAU * unit()).cos()
}

/// Random steps of the command; the answer to each in closed form, `K (1 - exp(-(t - t_i - delay)/tau))`, added up.
fn recording([gain, tau, delay, offset]: [f64; 4], noise: f64, seed: u64) -> Vec<AttitudeSample> {
    answered([gain, delay, offset], &|since| 1.0 - (-since / tau).exp(), noise, seed)
}

/// The same of second order; overdamped the answer is the sum of two decays.
fn second_order([gain, frequency, damping, delay, offset]: [f64; 5], noise: f64, seed: u64) -> Vec<AttitudeSample> {
    let step = |t: f64| {
        let decay = damping * frequency;
        if damping < 1.0 {
            let swing = frequency * (1.0 - damping * damping).sqrt();
            1.0 - (-decay * t).exp() * ((swing * t).cos() + decay / swing * (swing * t).sin())
        } else {
            let swing = frequency * (damping * damping - 1.0).sqrt();
            let [slow, fast] = [decay - swing, decay + swing];
            1.0 - (fast * (-slow * t).exp() - slow * (-fast * t).exp()) / (fast - slow)
        }
    };
    answered([gain, delay, offset], &step, noise, seed)
}

fn answered(
    [gain, delay, offset]: [f64; 3],
    answer: &dyn Fn(f64) -> f64,
    noise: f64,
    seed: u64,
) -> Vec<AttitudeSample> {
    let mut random = SplitMix64::seed_from_u64(seed);
    let step = |k: usize| 30 * (k / 30);
    let levels: Vec<f64> = (0..1500).map(|_| 0.15 * normal(&mut random)).collect();
    // Nothing before the first sample was commanded that differs from its command.
    let command = |k: usize| levels[step(k)];
    (0..1500)
        .map(|k| {
            let time = 0.01 * k as f64;
            let mut angle = gain * levels[0] + offset;
            for i in (30..=k).step_by(30) {
                let since = time - 0.01 * i as f64 - delay;
                if since > 0.0 {
                    angle += gain * (levels[i] - levels[i - 30]) * answer(since);
                }
            }
            AttitudeSample { time, commanded: command(k), measured: angle + noise * normal(&mut random) }
        })
        .collect()
}

#[test]
fn gain_lag_and_delay_are_found_without_noise() {
    for truth in [[1.017, 0.1847, 0.0, 0.0], [0.789, 0.175, 0.053, 0.02], [0.6, 0.04, 0.21, -0.1]] {
        let fit = identify_attitude(&recording(truth, 0.0, 4)).unwrap();
        let found = [fit.response.gain, fit.response.time_constant, fit.delay, fit.offset];
        for (found, truth) in found.iter().zip(truth) {
            assert!((found - truth).abs() < 1e-5, "{found} for {truth}");
        }
    }
}

/// The covariance is that of the errors: their normalised square is 3 in the mean.
#[test]
fn errors_are_as_large_as_their_covariance_says() {
    let truth = [0.789, 0.175, 0.053, 0.02];
    let (mut sum, count) = (0.0, 60);
    for seed in 0..count {
        let fit = identify_attitude(&recording(truth, 0.01, seed)).unwrap();
        let error =
            Vector3::new(fit.response.gain - truth[0], fit.response.time_constant - truth[1], fit.delay - truth[2]);
        assert!(error.amax() < 0.02, "{error}");
        let inverse: Matrix3<f64> = fit.covariance.try_inverse().unwrap();
        sum += error.dot(&(inverse * error));
        assert!((fit.residual - 0.01).abs() < 0.001);
    }
    let mean = sum / count as f64;
    // Chi-square of 3 degrees: the mean of 60 deviates by 0.32.
    assert!((mean - 3.0).abs() < 1.2, "{mean}");
}

/// Samples two time constants apart: what was measured follows the command, but the lag is lost in the noise.
#[test]
fn a_lag_that_is_not_known_is_refused() {
    let (interval, tau) = (0.25, 0.12);
    let recording = |noise: f64| {
        let mut random = SplitMix64::seed_from_u64(5);
        let (mut angle, mut held) = (0.0, 0.0);
        let sample = |k: usize| {
            angle = held + (angle - held) * f64::exp(-interval / tau);
            held = 0.15 * normal(&mut random);
            let measured = angle + noise * normal(&mut random);
            AttitudeSample { time: interval * k as f64, commanded: held, measured }
        };
        (0..60).map(sample).collect::<Vec<_>>()
    };
    let weak = identify_attitude(&recording(0.04));
    assert!(matches!(weak, Err(Error::Recording { what }) if what.contains("too weak")), "{weak:?}");
    let fit = identify_attitude(&recording(1e-5)).unwrap();
    assert!((fit.response.time_constant - tau).abs() < 0.1 * tau, "{fit:?}");
}

#[test]
fn recordings_that_tell_nothing_are_refused() {
    let good = recording([1.0, 0.2, 0.0, 0.0], 0.001, 1);
    let refused = |samples: &[AttitudeSample]| matches!(identify_attitude(samples), Err(Error::Recording { .. }));
    assert!(refused(&good[..20]));
    let still: Vec<_> = good.iter().map(|s| AttitudeSample { commanded: 0.1, ..*s }).collect();
    assert!(refused(&still));
    let mut random = SplitMix64::seed_from_u64(8);
    let noise: Vec<_> = good.iter().map(|s| AttitudeSample { measured: 0.1 * normal(&mut random), ..*s }).collect();
    assert!(refused(&noise));
    let drift: Vec<_> = good.iter().map(|s| AttitudeSample { measured: 0.01 * s.time, ..*s }).collect();
    assert!(refused(&drift));
    let mut twice = good.clone();
    twice[7].time = twice[6].time;
    assert!(refused(&twice));
    let mut holed = good;
    holed[3].measured = f64::NAN;
    assert!(refused(&holed));
}

#[test]
fn a_second_order_is_found_without_noise() {
    for truth in [[1.0, 9.0, 0.7, 0.02, 0.01], [0.8, 5.0, 0.3, 0.0, 0.0], [1.1, 12.0, 1.4, 0.05, -0.02]] {
        let fit = identify_second_order(&second_order(truth, 0.0, 4)).unwrap();
        let SecondOrderResponse { gain, natural_frequency, damping } = fit.response;
        for (found, truth) in [gain, natural_frequency, damping, fit.delay, fit.offset].iter().zip(truth) {
            assert!((found - truth).abs() < 1e-4, "{found} for {truth}");
        }
    }
}

#[test]
fn errors_of_a_second_order_are_as_large_as_their_covariance_says() {
    let truth = [0.9, 8.0, 0.6, 0.03, 0.01];
    let count = 60;
    let square = |seed: u64| {
        let fit = identify_second_order(&second_order(truth, 0.01, seed)).unwrap();
        let SecondOrderResponse { gain, natural_frequency, damping } = fit.response;
        let error = Vector4::new(gain, natural_frequency, damping, fit.delay) - Vector4::from_row_slice(&truth[..4]);
        error.dot(&(fit.covariance.try_inverse().unwrap() * error))
    };
    let mean = (0..count).map(square).sum::<f64>() / count as f64;
    // Chi-square of 4 degrees: the mean of 60 deviates by 0.37.
    assert!((mean - 4.0).abs() < 1.4, "{mean}");
}

/// Steps of a hundredth of a degree in noise of half a degree.
#[test]
fn an_excitation_that_is_too_weak_is_refused() {
    let mut random = SplitMix64::seed_from_u64(3);
    let weak: Vec<_> = recording([1.0, 0.2, 0.0, 0.0], 0.0, 1)
        .iter()
        .map(|s| AttitudeSample {
            time: s.time,
            commanded: 1e-3 * s.commanded,
            measured: 1e-3 * s.measured + 1e-4 * normal(&mut random),
        })
        .collect();
    for refused in [identify_attitude(&weak).err(), identify_second_order(&weak).err()] {
        assert!(matches!(refused, Some(Error::Recording { .. })), "{refused:?}");
    }
    // What does not turn back tells a gain over a lag only: a ramp that has not reached its end.
    let ramp: Vec<_> = (0..200)
        .map(|k| {
            let time = 0.01 * f64::from(k);
            let measured = 0.3 * (1.0 - (-time / 50.0).exp()) + 1e-4 * normal(&mut random);
            AttitudeSample { time, commanded: if k == 0 { 0.0 } else { 0.3 }, measured }
        })
        .collect();
    assert!(matches!(identify_attitude(&ramp), Err(Error::Recording { .. })));
}

/// The frequency of the sweep is what its phase turns by: as many turns between two times as the mean frequency says.
#[test]
fn the_sweep_keeps_its_amplitude_its_band_and_its_rests() {
    let excitation = Excitation::default();
    assert!((excitation.total_duration() - 64.0).abs() < 1e-12);
    let step = 1e-3;
    for (axis, begin) in [(0, 2.0), (1, 34.0)] {
        let at = |t: f64| excitation.at(begin + t);
        let crossings = |from: f64, to: f64| {
            let count = ((to - from) / step) as usize;
            (0..count)
                .filter(|k| {
                    (at(from + step * *k as f64)[axis] < 0.0) != (at(from + step * (*k + 1) as f64)[axis] < 0.0)
                })
                .count()
        };
        // 0.2 + 3.8 t / 30 Hz in the middle of each.
        for (from, to, frequency) in [(5.0, 15.0, 1.4667), (19.0, 29.0, 3.24)] {
            let expected = 2.0 * frequency * (to - from);
            assert!((crossings(from, to) as f64 - expected).abs() <= 1.0, "{} for {expected}", crossings(from, to));
        }
        let largest = (0..30_000).map(|k| at(step * f64::from(k))[axis].abs()).fold(0.0, f64::max);
        assert!((largest - 10.0_f64.to_radians()).abs() < 1e-4, "{largest}");
        assert!((0..30_000).all(|k| at(step * f64::from(k))[1 - axis] == 0.0));
        assert_eq!([excitation.at(begin - 0.01), excitation.at(begin + 30.0)], [[0.0; 2]; 2]);
    }
    let bad = [
        Excitation { amplitude: 0.5, ..excitation },
        Excitation { frequencies: [2.0, 1.0], ..excitation },
        Excitation { duration: f64::NAN, ..excitation },
        Excitation { tilt_limit: 2.0, ..excitation },
    ];
    assert!(bad.into_iter().all(|bad| matches!(Identification::new(bad), Err(Error::Setting { .. }))));
}

/// A loop of second order shows one, one of first order does not; commands end at the limit, and the recording has what was commanded.
#[test]
fn an_excitation_tells_the_order_of_the_loop() {
    let limit = 5.0_f64.to_radians();
    let excitation = Excitation { amplitude: limit, tilt_limit: limit, ..Excitation::default() };
    let mut identification = Identification::new(excitation).unwrap();
    let mut random = SplitMix64::seed_from_u64(9);
    let (mut roll, mut rate, mut pitch) = (0.0, 0.0, 0.0);
    for k in 0.. {
        let time = 0.01 * f64::from(k);
        if identification.is_over(time) {
            break;
        }
        let measured = [roll, pitch].map(|angle| angle + 1e-3 * normal(&mut random));
        let [to_roll, to_pitch] = identification.step(time, [0.02, -0.01], measured);
        assert!(to_roll.abs() <= limit && to_pitch.abs() <= limit);
        for _ in 0..100 {
            rate += 1e-4 * (64.0 * (to_roll - roll) - 2.0 * 0.7 * 8.0 * rate);
            roll += 1e-4 * rate;
            pitch += 1e-4 * (0.9 * to_pitch - pitch) / 0.15;
        }
    }
    let learnt = identification.finish().unwrap();
    let [shown, none] = &learnt.second_order;
    let shown = shown.as_ref().unwrap().response;
    assert!(
        (shown.natural_frequency / 8.0 - 1.0).abs() < 0.02 && (shown.damping / 0.7 - 1.0).abs() < 0.02,
        "{shown:?}"
    );
    assert!(none.is_none(), "{none:?}");
    let pitch = learnt.first_order[1].response;
    assert!((pitch.gain / 0.9 - 1.0).abs() < 0.01 && (pitch.time_constant / 0.15 - 1.0).abs() < 0.02, "{pitch:?}");
}
