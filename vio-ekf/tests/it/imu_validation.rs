//! Samples that cannot be: real readings pass as they are, and are refused when spoilt in any of the usual ways.

use std::fmt::Write as _;

use crate::support::flight::{Flight, GRAVITY};
use crate::support::recorded;
use crate::support::rng::Rng;
use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Vector2, Vector3};
use vio_ekf::filter::PointObservation;
use vio_ekf::format::{asl, euroc, tum};
use vio_ekf::imu_check::{AxesReading, ImuValidation, ImuWarning, check_imu_axes, validate_samples};
use vio_ekf::sim::{ImuModel, observe_points, swaying_flight};
use vio_ekf::trajectory::Spline;
use vio_ekf::{Camera, Error, Imu, Stamp, nalgebra};

/// A simulated flight that tilts by about 15 degrees, and real ones where they are there.
fn recordings() -> Vec<(&'static str, Vec<Imu>)> {
    let mut flight = Flight::new(3, 30.0);
    let stamps: Vec<Stamp> = flight.stamps().collect();
    let mut recordings = vec![("simulated", stamps.into_iter().map(|stamp| flight.imu(stamp)).collect())];
    for (name, file) in [("MH_04_difficult", "imu_MH04"), ("V1_02_medium", "imu_V102")] {
        if let Some(text) = recorded::text(&format!("vio/euroc_imu_gt/{name}/{file}.txt.gz")) {
            recordings.push((name, asl::read_imu(&text).unwrap()));
        }
    }
    recordings
}

fn with(samples: &[Imu], change: impl Fn(&Imu) -> Imu) -> Vec<Imu> {
    samples.iter().map(change).collect()
}

/// Whether axes or units are named, as a refusal or as a warning.
fn is_named(result: &Result<ImuValidation, Error>) -> bool {
    match result {
        Ok(validation) => validation.warnings.iter().any(|warning| matches!(warning, ImuWarning::Axes { .. })),
        Err(error) => matches!(error, Error::SwappedAxes { .. } | Error::NoGravity { .. }),
    }
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
                assert!(is_named(&result), "{name}: {axes} {result:?}");
            }
        }
        // Another frame for both sensors, but the same: nothing is wrong with it.
        let turned = with(&samples, |s| Imu { gyro: cycle * s.gyro, accel: cycle * s.accel, ..*s });
        assert!(validate_samples(&turned, 200.0, GRAVITY).is_ok(), "{name}");
        if name != "simulated" {
            continue;
        }
        let result = validate_samples(&with(&samples, |s| Imu { accel: cycle * s.accel, ..*s }), 200.0, GRAVITY);
        let hint = match result {
            Err(Error::SwappedAxes { hint }) => hint,
            Ok(ImuValidation { warnings, .. }) => match &warnings[..] {
                [ImuWarning::Axes { hint, .. }] => hint.clone(),
                other => panic!("{other:?}"),
            },
            Err(other) => panic!("{other}"),
        };
        // x came from y, y from z, z from x.
        assert_eq!(hint, "(z, x, y)");
    }
}

/// The readings of three EuRoC flights, in pieces of 15 to 50 s from every fifth second on.
#[test]
fn no_piece_of_a_real_recording_is_refused() {
    let files = [
        "vio/euroc_imu_gt/MH_04_difficult/imu_MH04.txt.gz",
        "vio/euroc_imu_gt/V1_02_medium/imu_V102.txt.gz",
        "vio/euroc_V1_01_micro/mav0/imu0/data.csv.gz",
    ];
    for file in files {
        let Some(text) = recorded::text(file) else { continue };
        let samples = asl::read_imu(&text).unwrap();
        let (mut pieces, mut refused, mut warned) = (0, Vec::new(), 0);
        for length in [15, 20, 30, 50] {
            for piece in (0..samples.len()).step_by(1000).filter_map(|from| samples.get(from..from + 200 * length)) {
                pieces += 1;
                match validate_samples(piece, 200.0, GRAVITY) {
                    Ok(validation) => warned += usize::from(!validation.warnings.is_empty()),
                    Err(error) => refused.push(error.to_string()),
                }
            }
        }
        eprintln!("{file}: {pieces} pieces, {} refused, {warned} with a warning", refused.len());
        assert!(refused.is_empty(), "{file}: {} of {pieces} refused: {}", refused.len(), refused[0]);
    }
}

/// Gravity smeared by a departure, m/s², and what the images say.
#[test]
fn only_what_gravity_and_images_contradict_is_refused() {
    let axes = |departure| ImuWarning::Axes { hint: "(y, x, z)".into(), departure, departure_of_hint: 0.1 };
    let reading = AxesReading { axes: Matrix3::identity(), in_degrees: false, unexplained: [1.0, 0.1] };
    let images = || ImuWarning::Images { sensor: "gyroscope", reading };
    let refused = |warnings: Vec<ImuWarning>| {
        ImuValidation { rate_hz: 200.0, gaps: 0, longest_gap_s: 0.005, warnings }.refuse_contradicted()
    };
    assert_eq!(refused(vec![axes(3.5), images()]), Err(Error::SwappedAxes { hint: "(y, x, z)".into() }));
    for warnings in [vec![], vec![axes(9.0)], vec![images()], vec![axes(3.4), images()]] {
        assert_eq!(refused(warnings), Ok(()));
    }
}

/// A body that rests for three seconds and then rocks about two axes on the spot, in closed form; its gyroscope has a bias.
fn rocking(gyro_bias: Vector3<f64>) -> Vec<Imu> {
    let sample = |k: u32| {
        let time = f64::from(k) / 200.0;
        let since = (time - 3.0).max(0.0);
        let moving = f64::from(u8::from(time > 3.0));
        let (roll, pitch) = (0.9 * (0.5 * since).sin(), 0.7 * (0.8 * since).sin());
        let (roll_rate, pitch_rate) = (0.45 * (0.5 * since).cos() * moving, 0.56 * (0.8 * since).cos() * moving);
        let about_x = Rotation3::from_axis_angle(&Vector3::x_axis(), roll);
        let about_y = Rotation3::from_axis_angle(&Vector3::y_axis(), pitch);
        let gyro = about_y.inverse() * Vector3::new(roll_rate, 0.0, 0.0) + Vector3::new(0.0, pitch_rate, 0.0);
        let accel = (about_x * about_y).inverse() * Vector3::new(0.0, 0.0, GRAVITY);
        Imu { stamp: Stamp::from_secs(time).unwrap(), gyro: gyro + gyro_bias, accel }
    };
    (0..12_000).map(sample).collect()
}

#[test]
fn a_gyroscope_with_a_bias_is_sound_and_its_axes_are_found_all_the_same() {
    let samples = rocking(Vector3::new(0.08, -0.07, 0.1));
    let sound = validate_samples(&samples, 200.0, GRAVITY).unwrap();
    assert!(sound.warnings.is_empty(), "{sound:?}");
    let cycle = Matrix3::new(0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0);
    let spoilt = validate_samples(&with(&samples, |s| Imu { accel: cycle * s.accel, ..*s }), 200.0, GRAVITY);
    assert!(is_named(&spoilt), "{spoilt:?}");
}

/// A rocking body whose accelerometer reads 1 % too much, and then 4 % too little.
#[test]
fn gravity_of_another_length_is_named() {
    let samples = rocking(Vector3::zeros());
    let found = |factor: f64| {
        let scaled = with(&samples, |s| Imu { accel: s.accel * factor, ..*s });
        validate_samples(&scaled, 200.0, GRAVITY).unwrap().warnings
    };
    assert_eq!(found(1.01), []);
    let [ImuWarning::Gravity { force, gravity }] = found(0.96)[..] else { panic!("{:?}", found(0.96)) };
    assert!((force - 0.96 * GRAVITY).abs() < 0.02 && gravity == GRAVITY, "{force}");
    assert!(found(0.96)[0].to_string().contains("-4.0 %"), "{}", found(0.96)[0]);
}

/// A level body carried round a circle: 12.7 m/s² all the time.
#[test]
fn a_hard_turn_is_flown_and_not_refused() {
    let sample = |k: u32| {
        let angle = 2.0 * f64::from(k) / 200.0;
        let accel = Vector3::new(8.0 * angle.cos(), 8.0 * angle.sin(), GRAVITY);
        Imu { stamp: Stamp::from_secs(f64::from(k) / 200.0).unwrap(), gyro: Vector3::zeros(), accel }
    };
    let samples: Vec<Imu> = (0..12_000).map(sample).collect();
    let found = validate_samples(&samples, 200.0, GRAVITY).unwrap();
    assert!(matches!(found.warnings[..], [ImuWarning::Force { .. }]), "{found:?}");
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

/// The motions of others that are there: name, and knots.
fn motions() -> Vec<(String, Spline)> {
    let files = [
        "trajectories/euroc/MH_01_easy.txt.gz",
        "trajectories/euroc/MH_03_medium.txt.gz",
        "vio/euroc_imu_gt/MH_04_difficult/groundtruth_MH_04_difficult.csv.gz",
        "vio/euroc_imu_gt/V1_02_medium/groundtruth_V1_02_medium.csv.gz",
        "trajectories/tum_vi/dataset-room1_512_16.txt.gz",
        "trajectories/tum_vi/dataset-room4_512_16.txt.gz",
        "trajectories/uzhfpv/indoor_forward_3_snapdragon_with_gt.txt.gz",
        "trajectories/uzhfpv/indoor_forward_5_snapdragon_with_gt.txt.gz",
        "trajectories/uzhfpv/outdoor_forward_5_snapdragon_with_gt.txt.gz",
        "trajectories/kaist_vio/circle_fast.txt.gz",
        "trajectories/kaist_vio/infinite_fast.txt.gz",
        "trajectories/kaist_vio/rotation.txt.gz",
        "trajectories/kaist_vio/square_head.txt.gz",
        "trajectories/evo/freiburg1_xyz-groundtruth.txt.gz",
        "trajectories/evo/fr2_desk_groundtruth.txt.gz",
    ];
    let read = |file: &str| {
        let text = recorded::text(file)?;
        let whole =
            if file.ends_with("csv.gz") { euroc::read(&text).unwrap().trajectory } else { tum::read(&text).unwrap() };
        let name = file.rsplit('/').next().unwrap().split('.').next().unwrap().into();
        Some((name, Spline::from_trajectory(&whole, 50_000_000).unwrap()))
    };
    files.iter().filter_map(|file| read(file)).collect()
}

type Fault = (&'static str, fn(&Imu) -> Imu);

/// Ways to spoil samples; each leaves a sensor that is right but for its axes or its unit.
const FAULTS: [Fault; 9] = [
    ("gyroscope negated", |s| Imu { gyro: -s.gyro, ..*s }),
    ("gyroscope in deg/s", |s| Imu { gyro: s.gyro * 180.0 / std::f64::consts::PI, ..*s }),
    ("accelerometer in g", |s| Imu { accel: s.accel / GRAVITY, ..*s }),
    ("accelerometer xy swapped", |s| Imu { accel: Vector3::new(s.accel.y, s.accel.x, s.accel.z), ..*s }),
    ("accelerometer xz swapped", |s| Imu { accel: Vector3::new(s.accel.z, s.accel.y, s.accel.x), ..*s }),
    ("accelerometer yz swapped", |s| Imu { accel: Vector3::new(s.accel.x, s.accel.z, s.accel.y), ..*s }),
    ("accelerometer cycled", |s| Imu { accel: Vector3::new(s.accel.y, s.accel.z, s.accel.x), ..*s }),
    ("accelerometer x flipped", |s| Imu { accel: Vector3::new(-s.accel.x, s.accel.y, s.accel.z), ..*s }),
    ("accelerometer z flipped", |s| Imu { accel: Vector3::new(s.accel.x, s.accel.y, -s.accel.z), ..*s }),
];

/// Points on the walls of a room around a motion, and what the camera sees of them ten times a second.
fn tracked_points(spline: &Spline, seed: u64) -> Vec<(Stamp, Vec<PointObservation>)> {
    let (first, last) = spline.span();
    let stamps = (1..).map(|k| first.plus_secs(0.1 * f64::from(k))).take_while(|stamp| *stamp < last);
    let stamps: Vec<Stamp> = stamps.collect();
    let (mut low, mut high) = (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
    for stamp in &stamps {
        let position = spline.sample(*stamp).unwrap().world_from_body.translation.vector;
        (low, high) = (low.inf(&position), high.sup(&position));
    }
    let mut rng = Rng::new(seed);
    let (middle, half) = ((low + high) * 0.5, (high - low) * 0.5 + Vector3::repeat(2.0));
    let points: Vec<Point3<f64>> = (0..600)
        .map(|_| {
            let mut point = rng.vector();
            let axis = (rng.bits() % 3) as usize;
            point[axis] = point[axis].signum();
            Point3::from(middle + point.component_mul(&half))
        })
        .collect();
    let mut see = |stamp: Stamp| {
        let pose = spline.sample(stamp).unwrap().world_from_body;
        let noise = || Vector2::new(rng.normal(), rng.normal()) * 0.5;
        (stamp, observe_points(points.iter(), &Camera::euroc(), &pose, 0.0, noise))
    };
    stamps.into_iter().map(&mut see).collect()
}

/// With the points that a camera follows, what is spoilt is named on every motion that shows it, and nothing else is.
#[test]
fn images_name_what_is_spoilt() {
    let [named, of] = named_by_images(&motions(), 3);
    assert!(named as f64 >= 0.95 * of as f64, "named {named} of {of}");
}

/// The same where no recorded motion is at hand.
#[test]
fn images_name_what_is_spoilt_in_a_swaying_flight() {
    let phases = [0.0, 1.0, 2.0, 3.0].map(|phase| Vector3::new(phase, phase + 2.0, 5.0 - phase));
    let [named, of] = named_by_images(&[("swaying".into(), swaying_flight(&phases, 20.0).unwrap())], 1);
    assert!(of == FAULTS.len() && named + 2 >= of, "named {named} of {of}");
}

/// How many faults of samples are named, and of how many.
fn named_by_images(motions: &[(String, Spline)], seeds: u64) -> [usize; 2] {
    let (mut named, mut runs, mut missed) = ([0; FAULTS.len()], 0, String::new());
    for (name, spline) in motions {
        for seed in 1..=seeds {
            let samples = ImuModel::default().record(spline, GRAVITY, seed).unwrap().samples;
            let images = tracked_points(spline, seed);
            let check = |samples: &[Imu]| check_imu_axes(samples, &images, &Camera::euroc(), (GRAVITY, 0.0)).unwrap();
            let sound = check(&samples);
            assert!(sound.gyro.is_none() && sound.accel.is_none(), "{name}, seed {seed}: {sound:?}");
            runs += 1;
            for (k, (fault, change)) in FAULTS.iter().enumerate() {
                let spoilt = with(&samples, change);
                let found = check(&spoilt);
                // A unit is named by the size of the force, without images.
                let is_named = found.gyro.is_some()
                    || found.accel.is_some()
                    || is_named(&validate_samples(&spoilt, 200.0, GRAVITY));
                // What is spoilt is one sensor: the other one must not be blamed.
                let blamed = if k < 2 { found.accel } else { found.gyro };
                assert!(blamed.is_none(), "{name}, seed {seed}, {fault}: {found:?}");
                named[k] += usize::from(is_named);
                if !is_named {
                    writeln!(missed, "    {name} {seed}: {fault} {found:?}").unwrap();
                }
            }
        }
    }
    let (all, of) = (named.iter().sum::<usize>(), runs * FAULTS.len());
    eprintln!(
        "named {all} of {of}; of {runs} each: {:?}\n{missed}",
        FAULTS.iter().map(|f| f.0).zip(named).collect::<Vec<_>>()
    );
    [all, of]
}

/// No motion that somebody has flown is refused, whatever the seed of the sensor.
#[test]
fn no_correct_motion_is_refused() {
    let motions = motions();
    let mut caught = [[0; 2]; FAULTS.len()];
    let mut runs = 0;
    for (name, spline) in &motions {
        for seed in 1..=3 {
            let model = ImuModel::default();
            let samples = model.record(spline, GRAVITY, seed).unwrap().samples;
            let verdict = validate_samples(&samples, 200.0, GRAVITY);
            let mut line = format!("{name} {seed}: {verdict:?}\n");
            runs += 1;
            for (k, (fault, change)) in FAULTS.iter().enumerate() {
                let spoilt = validate_samples(&with(&samples, change), 200.0, GRAVITY);
                caught[k][0] += usize::from(spoilt.is_err());
                caught[k][1] += usize::from(is_named(&spoilt));
                let text = spoilt.map_or_else(|e| e.to_string(), |v| format!("{:?}", v.warnings));
                writeln!(line, "    {fault}: {text}").unwrap();
            }
            eprintln!("{line}");
            assert!(verdict.is_ok() && !is_named(&verdict), "{name}, seed {seed}: {verdict:?}");
        }
    }
    for ((fault, _), [refused, named]) in FAULTS.iter().zip(caught) {
        eprintln!("{fault}: refused in {refused}, named in {named} of {runs}");
    }
}
