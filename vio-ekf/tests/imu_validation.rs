//! Samples that cannot be: real readings pass as they are, and are refused when spoilt in any of the usual ways.
#![allow(clippy::unwrap_used)]

mod support;

use nalgebra::{Isometry3, Matrix3, Vector3};
use support::flight::{Flight, GRAVITY};
use support::recorded;
use vio_ekf::sim::ImuModel;
use vio_ekf::{Error, Imu, Spline, Stamp, asl, nalgebra, validate_samples};

/// A simulated flight that tilts by about 15 degrees, and real ones where they are there.
fn recordings() -> Vec<(&'static str, Vec<Imu>)> {
    let mut flight = Flight::new(3, 30.0);
    let stamps: Vec<Stamp> = flight.stamps().collect();
    let mut recordings = vec![("simulated", stamps.into_iter().map(|stamp| flight.imu(stamp)).collect())];
    for (name, file) in [("MH_04_difficult", "imu_MH04"), ("V1_02_medium", "imu_V102")] {
        if let Some(text) = recorded(&format!("vio/euroc_imu_gt/{name}/{file}.txt.gz")) {
            recordings.push((name, asl::read_imu(&text).unwrap()));
        }
    }
    recordings
}

fn with(samples: &[Imu], change: impl Fn(&Imu) -> Imu) -> Vec<Imu> {
    samples.iter().map(change).collect()
}

#[test]
fn sound_samples_pass_and_swapped_axes_are_named() {
    for (name, samples) in recordings() {
        let findings = validate_samples(&samples, 200.0, GRAVITY).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert!((findings.rate_hz - 200.0).abs() < 1.0 && findings.longest_gap_s < 0.05, "{name}: {findings:?}");
        let swap = Matrix3::new(0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0);
        let cycle = Matrix3::new(0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0);
        let flip = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, -1.0));
        // The simulated flight tilts too little to tell the sign of a single axis from its accelerations.
        let candidates = if name == "simulated" { vec![swap, cycle] } else { vec![swap, cycle, flip] };
        for axes in candidates {
            for spoilt in [
                with(&samples, |s| Imu { accel: axes * s.accel, ..*s }),
                with(&samples, |s| Imu { gyro: axes * s.gyro, ..*s }),
            ] {
                let result = validate_samples(&spoilt, 200.0, GRAVITY);
                assert!(matches!(result, Err(Error::SwappedAxes { .. })), "{name}: {axes} {result:?}");
            }
        }
        // Another frame for both sensors, but the same: nothing is wrong with it.
        let turned = with(&samples, |s| Imu { gyro: cycle * s.gyro, accel: cycle * s.accel, ..*s });
        assert!(validate_samples(&turned, 200.0, GRAVITY).is_ok(), "{name}");
        if name != "simulated" {
            continue;
        }
        let Err(Error::SwappedAxes { hint }) =
            validate_samples(&with(&samples, |s| Imu { accel: cycle * s.accel, ..*s }), 200.0, GRAVITY)
        else {
            panic!("cycled axes pass")
        };
        // x came from y, y from z, z from x.
        assert_eq!(hint, "(z, x, y)");
    }
}

#[test]
fn units_rates_and_order_are_checked() {
    let (_, samples) = &recordings()[0];
    let has = |result: Result<_, Error>, words: &[&str]| {
        let text = result.err().map_or_else(|| panic!("passed: {words:?}"), |error: Error| error.to_string());
        assert!(words.iter().all(|word| text.contains(word)), "{text}");
    };
    let check = |samples: &[Imu], rate: f64| validate_samples(samples, rate, GRAVITY).map(|_| ());
    has(check(&with(samples, |s| Imu { accel: s.accel / GRAVITY, ..*s }), 200.0), &["m/s²", "unit", "gravity"]);
    has(check(samples, 100.0), &["200.0 Hz", "100.0 Hz"]);
    has(
        check(&with(samples, |s| Imu { stamp: Stamp::from_nanos(s.stamp.nanos() / 1000), ..*s }), 200.0),
        &["Hz", "unit of the stamps"],
    );
    has(check(&with(samples, |s| Imu { gyro: s.gyro * f64::NAN, ..*s }), 200.0), &["inertial sample 0"]);
    let mut swapped = samples.clone();
    swapped.swap(10, 11);
    has(check(&swapped, 200.0), &["stamp 11", "sort"]);
    has(check(&samples[..1], 200.0), &["inertial samples", "1 given"]);
    has(check(samples, 0.0), &["rate_hz"]);
    let with_gap: Vec<Imu> =
        samples.iter().enumerate().filter(|(k, _)| !(400..500).contains(k)).map(|(_, s)| *s).collect();
    let findings = validate_samples(&with_gap, 200.0, GRAVITY).unwrap();
    assert_eq!(findings.gaps, 1);
    assert!((findings.longest_gap_s - 0.505).abs() < 1e-9);
    assert_eq!(validate_samples(samples, 200.0, GRAVITY).unwrap().gaps, 0);
    // Five seconds of rest: nothing turns, nothing can be told, nothing is claimed.
    let rest: Vec<Imu> = (0..1000)
        .map(|k| Imu { stamp: Stamp::from_nanos(5_000_000 * k), gyro: Vector3::zeros(), accel: Vector3::x() * GRAVITY })
        .collect();
    assert!(validate_samples(&rest, 200.0, GRAVITY).is_ok());
}

/// A multirotor leans into the way it accelerates: its force stays along its own axis, whatever it does.
#[test]
fn a_flight_that_leans_as_it_accelerates_is_no_swap_of_axes() {
    let (frequency, reach) = (0.87_f64, 1.8);
    let knots = (0..200).map(|k| {
        let along = reach * (frequency * 0.05 * f64::from(k)).sin();
        let lean = (frequency * frequency * along / GRAVITY).atan();
        Isometry3::new(Vector3::new(0.0, along, 1.0), Vector3::new(lean, 0.0, 0.0))
    });
    let spline = Spline::new(Stamp::from_nanos(0), 50_000_000, knots.collect()).unwrap();
    let samples = ImuModel::ideal(200.0).record(&spline, GRAVITY, 1).unwrap().samples;
    // It does: sideways forces are below a tenth of what the acceleration is.
    assert!(samples.iter().all(|sample| sample.accel.xy().norm() < 0.15));
    assert!(validate_samples(&samples, 200.0, GRAVITY).is_ok());
}
