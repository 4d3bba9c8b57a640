//! Poses of others and an inertial sensor: accuracy, consistency, and the order of arrival.

use crate::support::flight::{Flight, nees};
use crate::support::rng::Rng;
use crate::support::tracker::Tracker;
use nalgebra::{Isometry3, Translation3, Vector3, Vector6};
use vio_ekf::eval::chi2;
use vio_ekf::fusion::{AlignmentSettings, ExtrinsicsSettings, FusionSettings, PoseFusion, PoseMeasurement, PoseSource};
use vio_ekf::inertial::{InitialSigma, InitialState};
use vio_ekf::lie::so3;
use vio_ekf::{Imu, ImuNoise, Odometry, Stamp, nalgebra};

/// Runs a filter over a flight with a pose every 50 ms that arrives 40 ms after it was taken.
fn run(
    flight: &mut Flight,
    source: &Tracker,
    assumed: PoseSource,
    start: &InitialState,
    mut each: impl FnMut(&Odometry, &vio_ekf::trajectory::Motion, &[Vector3<f64>; 2]),
) -> PoseFusion {
    let mut fusion = PoseFusion::new(flight.noise, &[assumed], FusionSettings::default()).unwrap();
    let first = flight.first();
    for (k, stamp) in flight.stamps().enumerate() {
        fusion.imu(&flight.imu(stamp)).unwrap();
        if k == 0 {
            fusion.initialize(start).unwrap();
        }
        let taken = Stamp::from_nanos(stamp.nanos() - 40_000_000);
        if taken > first && (k + 3) % 10 == 0 {
            fusion.pose(&source.pose(flight, taken)).unwrap();
        }
        let odometry = fusion.output().unwrap();
        assert_eq!(odometry.stamp, stamp);
        each(&odometry, &flight.truth(stamp), &flight.biases);
    }
    fusion
}

#[test]
fn a_circle_is_followed_without_any_pose() {
    // At constant rate ω about the vertical and speed v the body reads ω e_z and (0, v ω, g) in axes that look along the path.
    let (rate, speed, radius) = (0.8, 1.6, 2.0);
    let mut fusion = PoseFusion::new(ImuNoise::default(), &[PoseSource::default()], FusionSettings::default()).unwrap();
    let at = |k: i64| Stamp::from_nanos(k * 5_000_000);
    let biases = [Vector3::new(0.01, -0.02, 0.03), Vector3::new(0.2, 0.1, -0.1)];
    for k in 0..=400 {
        let sample = Imu {
            stamp: at(k),
            gyro: Vector3::z() * rate + biases[0],
            accel: Vector3::new(0.0, speed * rate, 9.81) + biases[1],
        };
        fusion.imu(&sample).unwrap();
        if k == 0 {
            let start = InitialState {
                stamp: at(0),
                world_from_body: Isometry3::translation(0.0, -radius, 1.0),
                velocity_in_body: Vector3::x() * speed,
                gyro_bias: biases[0],
                accel_bias: biases[1],
                sigma: InitialSigma::default(),
            };
            fusion.initialize(&start).unwrap();
        }
    }
    let output = fusion.output().unwrap();
    let angle: f64 = rate * 2.0;
    let expected = Vector3::new(radius * angle.sin(), -radius * angle.cos(), 1.0);
    assert!((output.world_from_body.translation.vector - expected).norm() < 2e-5, "{output:?}");
    assert!((output.velocity_in_body - Vector3::x() * speed).norm() < 2e-5);
    assert!((output.rate_in_body - Vector3::z() * rate).norm() < 1e-12);
    assert!(so3::log(&output.world_from_body.rotation).metric_distance(&(Vector3::z() * angle)) < 1e-9);
}

#[test]
fn follows_a_flight_and_knows_how_well() {
    let runs = 20;
    let mut sums: Vec<[f64; 5]> = vec![];
    for seed in 1..=runs {
        let mut flight = Flight::new(seed, 15.0);
        let source = Tracker { late: 30_000_000, ..Tracker::default() };
        let start = flight.drawn_start(InitialSigma { position: 0.05, yaw: 0.02, ..InitialSigma::default() });
        let mut index = 0;
        run(&mut flight, &source, source.known(), &start, |odometry, truth, biases| {
            if sums.len() <= index {
                sums.push([0.0; 5]);
            }
            for (sum, value) in sums[index].iter_mut().zip(nees(odometry, truth, biases)) {
                *sum += value / runs as f64;
            }
            index += 1;
            let off = truth.world_from_body.translation.vector - odometry.world_from_body.translation.vector;
            assert!(index < 200 || off.norm() < 0.04, "seed {seed}, sample {index}: {off}");
        });
    }
    let (low, high) = chi2::mean_band(3, runs as usize, 0.95).unwrap();
    let share =
        |k: usize| sums.iter().filter(|sums| (low..=high).contains(&sums[k])).count() as f64 / sums.len() as f64;
    let mean = |k: usize| sums.iter().map(|sums| sums[k]).sum::<f64>() / sums.len() as f64;
    for (k, what) in ["position", "attitude", "velocity", "gyro bias", "accel bias"].iter().enumerate() {
        eprintln!("{what}: mean {:.2}, in the band {:.2}", mean(k), share(k));
        assert!(share(k) > 0.8, "{what}: {}", share(k));
        assert!((2.5..3.5).contains(&mean(k)), "{what}: {}", mean(k));
    }
}

#[test]
fn finds_frame_place_scale_and_clock_of_the_source() {
    // Each number within what its own deviation allows, and the deviations themselves small.
    for seed in 1..=4 {
        let mut flight = Flight::new(seed, 30.0);
        let source = Tracker {
            source_from_world: Isometry3::new(Vector3::new(3.0, -2.0, 1.0), Vector3::new(0.0, 0.0, 0.8)),
            scale: 1.1,
            late: 60_000_000,
            ..Tracker::default()
        };
        let turned = |angle: f64, rng: &mut Rng| so3::exp(&(rng.vector().normalize() * angle));
        let extrinsics = source.body_from_sensor;
        let mut assumed = source.known();
        assumed.alignment = AlignmentSettings {
            source_from_world: Isometry3::from_parts(
                (source.source_from_world.translation.vector + flight.rng.vector() * 0.4).into(),
                so3::exp(&Vector3::new(0.02, -0.03, 0.5)) * source.source_from_world.rotation,
            ),
            position_sigma: 0.3,
            tilt_sigma: 0.03,
            yaw_sigma: 0.5,
            ..AlignmentSettings::default()
        };
        assumed.extrinsics = ExtrinsicsSettings {
            body_from_sensor: Isometry3::from_parts(
                (extrinsics.translation.vector + flight.rng.vector() * 0.05).into(),
                turned(0.05, &mut flight.rng) * extrinsics.rotation,
            ),
            position_sigma: 0.04,
            attitude_sigma: 0.04,
        };
        (assumed.scale, assumed.scale_sigma) = (1.0, 0.1);
        (assumed.time_offset_s, assumed.time_offset_sigma_s) = (-0.05, 0.01);
        // Position and yaw of the body are what is measured from.
        let start = flight.drawn_start(InitialSigma::default());
        let fusion = run(&mut flight, &source, assumed, &start, |_, _, _| ());
        let found = fusion.source_estimate(0).unwrap();
        let between = |a: &Isometry3<f64>, b: &Isometry3<f64>| {
            let shift = a.translation.vector - b.translation.vector;
            let turn = so3::log(&(a.rotation * b.rotation.inverse()));
            Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z)
        };
        let mut error = nalgebra::SVector::<f64, 14>::zeros();
        error.fixed_rows_mut::<6>(0).copy_from(&between(&source.source_from_world, &found.source_from_world));
        error.fixed_rows_mut::<6>(6).copy_from(&between(&extrinsics, &found.body_from_sensor));
        error[12] = (source.scale / found.scale).ln();
        error[13] = -0.06 - found.time_offset_s;
        let square = error.dot(&found.covariance.cholesky().unwrap().solve(&error));
        let sigma = found.covariance.map_diagonal(f64::sqrt);
        eprintln!("seed {seed}: {square:.1}\n error {error:.5?}\n sigma {sigma:.5?}");
        assert!(square < chi2::quantile(0.999, 14).unwrap(), "seed {seed}: {square}");
        assert!(sigma.fixed_rows::<3>(3).max() < 0.01 && sigma[12] < 0.002 && sigma[13] < 1e-3, "{sigma}");
        assert!(error[5].abs() < 0.02 && error[13].abs() < 2e-3, "{error}");
    }
}

#[test]
fn follows_a_source_that_drifts() {
    // Its frame turns about the body and shifts; the world's own position and yaw must then be given up as slowly.
    let mut flight = Flight::new(5, 25.0);
    let source = Tracker::default();
    let mut assumed = source.known();
    (assumed.alignment.position_walk, assumed.alignment.yaw_walk) = (0.02, 0.01);
    let start = flight.drawn_start(InitialSigma::default());
    let mut fusion = PoseFusion::new(flight.noise, &[assumed], FusionSettings::default()).unwrap();
    let (mut drift, mut worst) = (Isometry3::identity(), 0.0_f64);
    for (k, stamp) in flight.stamps().enumerate() {
        fusion.imu(&flight.imu(stamp)).unwrap();
        if k == 0 {
            fusion.initialize(&start).unwrap();
            continue;
        }
        let root = 0.005_f64.sqrt();
        let here = Translation3::from(flight.truth(stamp).world_from_body.translation.vector);
        let turn = so3::exp(&(Vector3::z() * (flight.rng.normal() * 0.01 * root)));
        let shift = Translation3::from(flight.rng.normals() * (0.02 * root));
        drift = drift * here * (shift * Isometry3::from_parts(Translation3::identity(), turn)) * here.inverse();
        if k % 10 == 0 {
            let now = Tracker { source_from_world: drift, ..source };
            fusion.pose(&now.pose(&mut flight, stamp)).unwrap();
            assert_eq!(fusion.consecutive_outliers(), 0, "sample {k}");
            let output = fusion.output().unwrap();
            let truth = flight.truth(stamp).world_from_body;
            let off = truth.translation.vector - output.world_from_body.translation.vector;
            let covariance = output.covariance.fixed_view::<3, 3>(0, 0).into_owned();
            worst = worst.max(off.dot(&covariance.cholesky().unwrap().solve(&off)));
        }
    }
    let sigma = fusion.output().unwrap().covariance.fixed_view::<3, 3>(0, 0).trace().sqrt();
    eprintln!("largest square {worst:.1}, deviation at the end {sigma:.3} m");
    assert!(worst < 25.0, "{worst}");
    // The walk alone makes 0.02 √(3·25) m; the inertial sensor holds on to little of it.
    assert!((0.08..0.5).contains(&sigma), "{sigma}");
}

/// Samples, poses of two sources, and a filter for them.
fn two_sources(seed: u64) -> (Vec<Imu>, Vec<(usize, PoseMeasurement)>, PoseFusion, InitialState) {
    let mut flight = Flight::new(seed, 4.0);
    let sources = [Tracker::default(), Tracker { late: 20_000_000, position_sigma: 0.03, ..Tracker::default() }];
    let start = flight.drawn_start(InitialSigma { position: 0.05, yaw: 0.02, ..InitialSigma::default() });
    let stamps: Vec<_> = flight.stamps().collect();
    let samples: Vec<_> = stamps.iter().map(|stamp| flight.imu(*stamp)).collect();
    let mut poses = vec![];
    for (which, source) in sources.iter().enumerate() {
        for (k, stamp) in stamps.iter().enumerate().skip(1).step_by(7 + 2 * which) {
            // Between samples, and both sources at one time now and then.
            let taken = Stamp::from_nanos((stamp.nanos() + 1_300_000).min(flight.spline.span().1.nanos()));
            let mut pose = source.pose(&mut flight, taken);
            pose.source = which;
            if k % 5 == 0 {
                pose.source_from_sensor.translation.vector.x += 2.0;
            }
            poses.push((k, pose));
        }
    }
    let mut assumed = sources.map(|source| source.known());
    assumed[1].alignment.yaw_sigma = 0.1;
    assumed[1].time_offset_sigma_s = 0.005;
    let fusion = PoseFusion::new(flight.noise, &assumed, FusionSettings::default()).unwrap();
    (samples, poses, fusion, start)
}

#[test]
fn order_of_arrival_does_not_matter() {
    let (samples, poses, fusion, start) = two_sources(8);
    // Poses arrive when the sample has come that is `delay` after them, in the order that the random numbers say.
    let feed = |delay: &mut dyn FnMut(usize) -> usize| {
        let mut fusion = fusion.clone();
        let mut due: Vec<_> = poses.iter().map(|(k, pose)| (k + delay(*k), pose)).collect();
        due.sort_by_key(|(k, _)| *k);
        let mut due = due.into_iter().peekable();
        for (k, sample) in samples.iter().enumerate() {
            fusion.imu(sample).unwrap();
            if k == 0 {
                fusion.initialize(&start).unwrap();
            }
            while let Some((_, pose)) = due.next_if(|(at, _)| *at <= k || k + 1 == samples.len()) {
                fusion.pose(pose).unwrap();
            }
        }
        (fusion.output().unwrap(), fusion.source_estimate(0).unwrap(), fusion.source_estimate(1).unwrap())
    };
    let prompt = feed(&mut |_| 1);
    for seed in 0..6 {
        let mut rng = Rng::new(seed);
        let shuffled = feed(&mut |_| (rng.bits() % 150) as usize);
        assert_eq!(prompt, shuffled, "seed {seed}");
    }
    // Before the samples that they lie between, as well.
    assert_eq!(prompt, feed(&mut |_| 0));
}
