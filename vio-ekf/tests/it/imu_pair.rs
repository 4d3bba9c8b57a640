//! Two inertial sensors joined into one: noise, walk, lever arm, silence.

use crate::support::flight::{Flight, GRAVITY};
use crate::support::imus::{bias, models, settings};
use nalgebra::Vector3;
use vio_ekf::fusion::{ImuPair, ImuPairSettings};
use vio_ekf::sim::ImuModel;
use vio_ekf::{Imu, ImuNoise, Stamp, nalgebra};

/// All samples of a pair, with those of the second sensor until a time.
fn joined(pair: &mut ImuPair, first: &[Imu], second: &[Imu]) -> Vec<Imu> {
    let mut read = vec![];
    let mut second = second.iter().peekable();
    for sample in first {
        pair.first(sample).unwrap();
        while let Some(other) = second.next_if(|other| other.stamp <= sample.stamp) {
            pair.second(other).unwrap();
        }
        while let Some(sample) = pair.read() {
            read.push(sample);
        }
    }
    read
}

#[test]
fn a_pair_reads_what_the_better_sensor_would() {
    // White noise by the spread of single samples, walk by the bias itself: both as the densities of the pair say.
    let models = models();
    let flight = Flight::new(1, 60.0);
    let (mut white, mut walked, mut count, mut pairs) = ([0.0; 2], [0.0; 2], 0.0, 0.0);
    for seed in 0..6 {
        let recordings = [
            models[0].record(&flight.spline, GRAVITY, 10 + seed).unwrap(),
            models[1].record(&flight.spline, GRAVITY, 50 + seed).unwrap(),
        ];
        let mut pair = ImuPair::new(settings(&models)).unwrap();
        let shares = pair.bias_shares();
        let read = joined(&mut pair, &recordings[0].samples, &recordings[1].samples);
        assert_eq!(read.len(), recordings[0].samples.len());
        let turn = models[1].body_from_imu.rotation;
        let mut last: Option<[Vector3<f64>; 2]> = None;
        for sample in read.iter().skip(1000) {
            let motion = flight.spline.sample(sample.stamp).unwrap();
            let bias = bias(&recordings, &turn, shares, sample.stamp);
            let noise =
                [sample.gyro - motion.rate_in_body - bias[0], sample.accel - motion.specific_force(GRAVITY) - bias[1]];
            for k in 0..2 {
                white[k] += noise[k].norm_squared() / 3.0;
            }
            count += 1.0;
            if let Some(last) = last {
                for k in 0..2 {
                    walked[k] += (bias[k] - last[k]).norm_squared() / 3.0;
                }
                pairs += 1.0;
            }
            last = Some(bias);
        }
    }
    let noise = ImuPair::new(settings(&models)).unwrap().noise();
    let density = white.map(|sum| f64::sqrt(sum / count / 200.0));
    let walk = walked.map(|sum| f64::sqrt(sum / pairs * 200.0));
    eprintln!("{density:?}, {walk:?}, {noise:?}");
    assert!((density[0] / noise.gyro_density - 1.0).abs() < 0.02, "{density:?}");
    assert!((walk[0] / noise.gyro_walk - 1.0).abs() < 0.02 && (walk[1] / noise.accel_walk - 1.0).abs() < 0.02);
    // The force has the difference of rates at the lever arm on top, which integrates to nothing: so integrate.
    assert!(density[1] > noise.accel_density && density[1] < 3.0 * noise.accel_density, "{density:?}");
    assert!(noise.gyro_density < 1.6968e-4 && noise.accel_density < 2e-3);
}

#[test]
fn a_pair_integrates_to_the_velocity_of_the_body() {
    // The mean force over a second, noise-free and with noise: a lever arm that is forgotten costs 10 times as much.
    let mut models = models();
    let flight = Flight::new(2, 20.0);
    let mut error_over = |noisy: bool| {
        if !noisy {
            for model in &mut models {
                *model = ImuModel { body_from_imu: model.body_from_imu, ..ImuModel::ideal(200.0) };
            }
        }
        let settings =
            ImuPairSettings { second: ImuNoise { gyro_density: 3e-4, ..ImuNoise::default() }, ..settings(&models) };
        let first = if noisy { settings.first } else { ImuNoise::default() };
        let recordings = [0, 1].map(|k| models[k].record(&flight.spline, GRAVITY, 7 + k as u64).unwrap());
        let mut pair = ImuPair::new(ImuPairSettings { first, ..settings }).unwrap();
        let shares = pair.bias_shares();
        let read = joined(&mut pair, &recordings[0].samples, &recordings[1].samples);
        let turn = models[1].body_from_imu.rotation;
        let windows = read[400..].chunks_exact(200).map(|window| {
            let mut sum = Vector3::zeros();
            for sample in window {
                let motion = flight.spline.sample(sample.stamp).unwrap();
                sum +=
                    sample.accel - motion.specific_force(GRAVITY) - bias(&recordings, &turn, shares, sample.stamp)[1];
            }
            (sum / 200.0).norm_squared() / 3.0
        });
        let squares: Vec<f64> = windows.collect();
        (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
    };
    let (noisy, ideal) = (error_over(true), error_over(false));
    eprintln!("{noisy:.2e} m/s with noise, {ideal:.2e} m/s without, per second");
    // White noise of 2e-3 and of the same on the other side makes 1.4e-3 in a second; the difference of biases a little.
    assert!(noisy < 2.2e-3, "{noisy}");
    assert!(ideal < 5e-4, "{ideal}");
}

#[test]
fn a_silent_second_sensor_is_not_missed() {
    let models = models();
    let flight = Flight::new(3, 20.0);
    let recordings = [0, 1].map(|k| models[k].record(&flight.spline, GRAVITY, 3 + k as u64).unwrap());
    let mut pair = ImuPair::new(settings(&models)).unwrap();
    let shares = pair.bias_shares();
    let half = recordings[1].samples.len() / 2;
    let read = joined(&mut pair, &recordings[0].samples, &recordings[1].samples[..half]);
    // All but the last few, which still wait for the second.
    assert!(read.len() + 5 >= recordings[0].samples.len(), "{}", read.len());
    // The mean of a second on either side of the silence has the same bias: white noise allows 2e-4 rad/s, three times over.
    let turn = models[1].body_from_imu.rotation;
    let mean = |from: usize| {
        let window = &read[from..from + 200];
        let rate = |s: &Imu| s.gyro - flight.spline.sample(s.stamp).unwrap().rate_in_body;
        let off = |s: &Imu| rate(s) - bias(&recordings, &turn, shares, s.stamp)[0];
        window.iter().map(off).sum::<Vector3<f64>>() / 200.0
    };
    let (before, after) = (mean(half - 250), mean(half + 50));
    assert!(before.amax() < 6e-4 && after.amax() < 8e-4, "{before} {after}");
    // Without the difference of the biases the step would be many times that.
    let other = recordings[1].biases_at(read[half].stamp).0;
    let difference = (recordings[0].biases_at(read[half].stamp).0 - turn * other).amax();
    assert!(difference > 5e-3, "{difference}");
}

#[test]
fn a_second_sensor_is_silent_after_its_time_and_not_before() {
    // At rest, the sensors in one place; the second turns by 1 rad/s more. It is read at 0 and `gap` later, and asked for between.
    let read = |gap: f64| {
        let settings = ImuPairSettings { timeout_s: 0.5, ..ImuPairSettings::default() };
        let mut pair = ImuPair::new(settings).unwrap();
        let at = |seconds: f64, rate: f64| Imu {
            stamp: Stamp::from_secs(seconds).unwrap(),
            gyro: Vector3::new(rate, 0.0, 0.0),
            accel: Vector3::new(0.0, 0.0, 9.81),
        };
        pair.second(&at(0.0, 1.0)).unwrap();
        pair.first(&at(0.25, 0.0)).unwrap();
        pair.second(&at(gap, 1.0)).unwrap();
        // Nobody waits for the second any longer.
        pair.first(&at(0.75, 0.0)).unwrap();
        pair.read().unwrap().gyro.x
    };
    assert!(read(0.5) > 0.1, "{}", read(0.5));
    assert_eq!(read(0.501), 0.0);
    // One that has been silent for so long already is not waited for.
    let settings = ImuPairSettings { timeout_s: 0.01, ..ImuPairSettings::default() };
    let mut pair = ImuPair::new(settings).unwrap();
    let at = |millis: i64| Imu {
        stamp: Stamp::from_nanos(1_000_000 * millis),
        gyro: Vector3::zeros(),
        accel: Vector3::new(0.0, 0.0, 9.81),
    };
    pair.second(&at(0)).unwrap();
    for (millis, waits) in [(5, true), (10, false), (15, false)] {
        pair.first(&at(millis)).unwrap();
        assert_eq!(pair.read().is_none(), waits, "{millis}");
        while pair.read().is_some() {}
    }
}

/// Of a body that turns; the first sensor is silent for a second, and what it says late of it is left out.
#[test]
fn the_second_sensor_stands_in_for_a_silent_first() {
    let models = models();
    let flight = Flight::new(3, 20.0);
    let recordings = [0, 1].map(|k| models[k].record(&flight.spline, GRAVITY, 3 + k as u64).unwrap());
    let [first, second] = &recordings;
    let mut pair = ImuPair::new(settings(&models)).unwrap();
    let shares = pair.bias_shares();
    let [from, until] = [2000, 2200].map(|k| first.samples[k].stamp);
    let mut others = second.samples.iter().peekable();
    let mut read: Vec<Imu> = vec![];
    for (k, sample) in first.samples.iter().enumerate().take(4000) {
        match k {
            2000..2200 => {}
            // All at once.
            2200 => first.samples[2000..=2200].iter().for_each(|late| pair.first(late).unwrap()),
            _ => pair.first(sample).unwrap(),
        }
        while let Some(other) = others.next_if(|other| other.stamp <= sample.stamp) {
            pair.second(other).unwrap();
            read.extend(std::iter::from_fn(|| pair.read()));
        }
    }
    assert!(read.windows(2).all(|two| two[1].stamp > two[0].stamp && two[1].stamp.secs_since(two[0].stamp) < 0.011));
    let within: Vec<&Imu> = read.iter().filter(|sample| sample.stamp > from && sample.stamp < until).collect();
    assert!(within.len() > 150, "{}", within.len());
    // The same bias as before, with the second's noise: over a second that leaves 2e-4 rad/s and 2e-3 m/s².
    let turn = models[1].body_from_imu.rotation;
    let off = |sample: &&Imu| {
        let motion = flight.spline.sample(sample.stamp).unwrap();
        let bias = bias(&recordings, &turn, shares, sample.stamp);
        [sample.gyro - motion.rate_in_body - bias[0], sample.accel - motion.specific_force(GRAVITY) - bias[1]]
    };
    let mean = |k: usize| within.iter().map(|sample| off(sample)[k]).sum::<Vector3<f64>>() / within.len() as f64;
    let [gyro, accel] = [0, 1].map(|k| mean(k).amax());
    assert!(gyro < 8e-4 && accel < 0.02, "{gyro} {accel}");
}
