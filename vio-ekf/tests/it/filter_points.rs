//! The filter on points: accuracy, consistency, and what it must not claim to know.

use crate::support::flight::{Flight, nees};
use nalgebra::{Isometry3, SVector};
use vio_ekf::eval::chi2;
use vio_ekf::filter::{CalibrationSettings, DynamicInitializationSettings, LandmarkSettings, PointObservation};
use vio_ekf::inertial::{ImuSettings, InitialSigma, InitialState};
use vio_ekf::lie::so3;
use vio_ekf::{Error, ImageView, Imu, Settings, Stamp, Status, Vio, nalgebra};

#[test]
fn follows_a_flight_and_knows_how_well() {
    // At a pixel and at a tenth of it, where everything that is not linear shows.
    let (runs, seconds) = (6, 15.0);
    for pixel_sigma in [1.0, 0.1] {
        let mut sums = vec![];
        for seed in 1..=runs {
            let mut flight = Flight::new(seed, seconds);
            flight.pixel_sigma = pixel_sigma;
            let start = flight.drawn_start(InitialSigma::default());
            let landmarks = LandmarkSettings { pixel_sigma, ..LandmarkSettings::default() };
            let mut frame = 0;
            flight
                .run(&Settings { landmarks, ..Settings::default() }, &start, |odometry, truth, biases| {
                    if sums.len() <= frame {
                        sums.push([0.0; 5]);
                    }
                    for (sum, value) in sums[frame].iter_mut().zip(nees(odometry, truth, biases)) {
                        *sum += value / runs as f64;
                    }
                    frame += 1;
                    let off = truth.world_from_body.translation.vector - odometry.world_from_body.translation.vector;
                    assert!(off.norm() < 0.15, "seed {seed}, frame {frame}: {off}");
                })
                .unwrap();
        }
        let (low, high) = chi2::mean_band(3, runs as usize, 0.95).unwrap();
        let mut inside = [0; 5];
        for sums in &sums {
            for (inside, sum) in inside.iter_mut().zip(sums) {
                *inside += usize::from((low..=high).contains(sum));
            }
        }
        let share = inside.map(|n| n as f64 / sums.len() as f64);
        let mean: [f64; 5] = std::array::from_fn(|k| sums.iter().map(|s| s[k]).sum::<f64>() / sums.len() as f64);
        eprintln!("{pixel_sigma} px: share in the band {share:.2?}, mean {mean:.2?}");
        // Position, attitude, velocity, biases. Errors of successive frames are one error: six runs are few.
        assert!(share.iter().all(|s| *s > 0.7), "{share:?}");
        assert!(mean.iter().all(|m| (2.0..4.5).contains(m)), "{mean:?}");
    }
}

#[test]
fn learns_nothing_about_position_and_yaw() {
    // What gravity and a camera cannot see must stay as uncertain as it was, however many images: not one bit is learnt.
    for (position, yaw) in [(10.0, 0.0), (0.0, 0.5)] {
        let mut flight = Flight::new(3, 12.0);
        let start = flight.drawn_start(InitialSigma { position, yaw, ..InitialSigma::default() });
        let mut least = f64::INFINITY;
        flight
            .run(&Settings::default(), &start, |odometry, _, _| {
                let of_yaw = odometry.covariance[(8, 8)] - yaw * yaw;
                let of_position =
                    odometry.covariance.fixed_view::<3, 3>(0, 0).into_owned().symmetric_eigenvalues().min();
                least = least
                    .min(of_yaw / (1.0 + yaw * yaw))
                    .min((of_position - position * position) / (1.0 + position * position));
            })
            .unwrap();
        assert!(least > -1e-10, "position {position}, yaw {yaw}: lost {least}");
    }
}

#[test]
fn order_of_arrival_does_not_matter() {
    // Images that come 40 samples late, several in a row, change the output by not a single bit.
    let feed = |delay: usize, settings: Settings| {
        let mut flight = Flight::new(5, 6.0);
        let start = flight.drawn_start(InitialSigma::default());
        let mut vio = Vio::new(flight.camera, flight.noise, settings).unwrap();
        let stamps: Vec<_> = flight.stamps().collect();
        let samples: Vec<_> = stamps.iter().map(|s| flight.imu(*s)).collect();
        let images: Vec<_> = stamps.iter().step_by(10).skip(1).map(|s| (*s, flight.see(*s))).collect();
        let mut waiting = images.iter();
        let mut next = waiting.next();
        for (k, sample) in samples.iter().enumerate() {
            vio.imu(sample).unwrap();
            if k == 0 {
                vio.initialize(&start).unwrap();
            }
            while let Some((stamp, points)) = next
                && (k + 1 == samples.len() || k >= delay && *stamp <= samples[k - delay].stamp)
            {
                vio.points(*stamp, points).unwrap();
                next = waiting.next();
            }
        }
        vio.output().unwrap()
    };
    // Also where the samples are not believed: what is held of them must not depend on when it is asked for.
    let doubting = ImuSettings { gyro_range: 0.3, noise_inflation: 0.5, ..ImuSettings::default() };
    let doubting = Settings { imu: doubting, ..Settings::default() };
    assert_eq!(feed(0, Settings::default()), feed(40, Settings::default()));
    assert_eq!(feed(0, doubting), feed(40, doubting));
    assert_ne!(feed(0, doubting), feed(0, Settings::default()));
}

#[test]
fn finds_the_cameras_place_and_clock() {
    // 3 degrees, 3 cm and 10 ms off, in random directions.
    for seed in [2, 9] {
        let mut flight = Flight::new(seed, 21.0);
        flight.time_offset = 10_000_000;
        let truth = flight.camera.body_from_camera;
        let turn = flight.rng.vector().normalize() * 3_f64.to_radians();
        let shift = flight.rng.vector().normalize() * 0.03;
        flight.camera.body_from_camera =
            Isometry3::from_parts((truth.translation.vector + shift).into(), so3::exp(&turn) * truth.rotation);
        let assumed = flight.camera;
        flight.camera.body_from_camera = truth;
        let start = flight.drawn_start(InitialSigma::default());
        let calibration = CalibrationSettings {
            camera_position_sigma_m: 0.02,
            camera_attitude_sigma: 0.03,
            time_offset_s: 0.0,
            time_offset_sigma_s: Some(0.01),
            stamp_jitter_s: 0.0,
            ..CalibrationSettings::default()
        };
        let vio =
            flight.run_with(assumed, &Settings { calibration, ..Settings::default() }, &start, |_, _, _| ()).unwrap();
        let found = vio.calibration().unwrap();
        let turn = so3::log(&(truth.rotation * found.body_from_camera.rotation.inverse()));
        let shift = truth.translation.vector - found.body_from_camera.translation.vector;
        let late = 0.01 - found.time_offset_s;
        eprintln!(
            "seed {seed}: {:.3} deg, {:.2} mm, {:.3} ms",
            turn.norm().to_degrees(),
            shift.norm() * 1e3,
            late * 1e3
        );
        let error = SVector::<f64, 7>::from_iterator(shift.iter().chain(turn.iter()).copied().chain([late]));
        let square = error.dot(&found.covariance.cholesky().unwrap().solve(&error));
        assert!(square < chi2::quantile(0.999, 7).unwrap(), "seed {seed}: {square}");
        assert!(turn.norm() < 0.2_f64.to_radians() && late.abs() < 1e-3, "seed {seed}");
        assert!(shift.norm() < 5e-3, "seed {seed}: {shift}");
    }
}

#[test]
fn stamps_that_jitter_are_seen_through() {
    // Stamps off by 5 ms, on a flight that turns at half a radian per second: two pixels and a half on all landmarks at once.
    let error = |stamp_jitter_s: f64| {
        let mut sum = 0.0;
        for seed in 1..=3 {
            let mut flight = Flight::new(seed, 10.0);
            let start = flight.drawn_start(InitialSigma::default());
            let calibration = CalibrationSettings { stamp_jitter_s, ..CalibrationSettings::default() };
            let settings = Settings { calibration, ..Settings::default() };
            let mut vio = Vio::new(flight.camera, flight.noise, settings).unwrap();
            let stamps: Vec<Stamp> = flight.stamps().collect();
            for (k, &stamp) in stamps.iter().enumerate() {
                vio.imu(&flight.imu(stamp)).unwrap();
                if k == 0 {
                    vio.initialize(&start).unwrap();
                } else if k % 10 == 0 {
                    let seen = flight.see(stamp);
                    let jitter = flight.rng.normal() * 0.005;
                    vio.points(Stamp::from_nanos(stamp.nanos() + (jitter * 1e9) as i64), &seen).unwrap();
                    let odometry = vio.output().unwrap();
                    let truth = flight.truth(odometry.stamp.min(flight.spline.span().1)).world_from_body;
                    sum += (truth.translation.vector - odometry.world_from_body.translation.vector).norm_squared();
                }
            }
        }
        sum
    };
    let (known, unknown) = (error(0.005), error(0.0));
    eprintln!("squared errors {known:.3}, and {unknown:.3} if the jitter is not known");
    assert!(known < 0.3 * unknown, "{known} {unknown}");
}

#[test]
fn refuses_what_it_cannot_use() {
    let mut flight = Flight::new(1, 2.0);
    let settings =
        Settings { landmarks: LandmarkSettings { max_count: 0, ..LandmarkSettings::default() }, ..Settings::default() };
    assert!(matches!(
        Vio::new(flight.camera, flight.noise, settings),
        Err(Error::InvalidSetting { name: "landmarks.max_count", .. })
    ));
    let dynamic_initialization =
        DynamicInitializationSettings { pixel_sigma: 0.0, ..DynamicInitializationSettings::default() };
    let settings = Settings { dynamic_initialization, ..Settings::default() };
    assert!(matches!(
        Vio::new(flight.camera, flight.noise, settings),
        Err(Error::InvalidSetting { name: "dynamic_initialization.pixel_sigma", .. })
    ));
    let mut vio = Vio::new(flight.camera, flight.noise, Settings::default()).unwrap();
    let start = flight.drawn_start(InitialSigma::default());
    assert!(matches!(vio.initialize(&start), Err(Error::TooFew { .. })));
    assert!(vio.output().is_none());
    let first = flight.first();
    let sample = flight.imu(first);
    let bad = Imu { gyro: nalgebra::Vector3::new(f64::NAN, 0.0, 0.0), ..sample };
    assert!(matches!(vio.imu(&bad), Err(Error::NonFinite { .. })));
    vio.imu(&sample).unwrap();
    assert!(matches!(vio.imu(&sample), Err(Error::NotIncreasing { .. })));
    // Before the start images are looked at, not used.
    assert_eq!(vio.points(first, &[]).unwrap().used, 0);
    let bad = InitialState { accel_bias: nalgebra::Vector3::repeat(f64::INFINITY), ..start };
    assert!(matches!(vio.initialize(&bad), Err(Error::NonFinite { .. })));
    vio.initialize(&start).unwrap();
    let later = |ms: i64| Stamp::from_nanos(first.nanos() + ms * 1_000_000);
    vio.imu(&flight.imu(later(5))).unwrap();
    vio.points(later(5), &flight.see(later(5))).unwrap();
    assert!(matches!(vio.points(later(5), &[]), Err(Error::Late { .. })));
    assert!(matches!(vio.points(later(500), &[]), Err(Error::OutOfRange { .. })));
    let nan = PointObservation { id: 0, pixel: nalgebra::Vector2::new(0.0, f64::NAN) };
    assert!(matches!(vio.points(later(10), &[nan]), Err(Error::NonFinite { .. })));
    let small = ImageView { width: 4, height: 4, data: &[0; 16] };
    assert!(matches!(vio.image(later(10), &small), Err(Error::ImageSize { .. })));
    // Nothing of this has hurt.
    assert_eq!(vio.status(), Status::Tracking);
    // A sensor that goes on without any image is followed until its uncertainty says that it is no longer an estimate.
    let mut spoilt = vio.clone();
    for k in 2..=300 {
        spoilt.imu(&flight.imu(later(5 * k))).unwrap();
    }
    let output = spoilt.output().unwrap();
    assert!(output.covariance.iter().all(|v| v.is_finite()) && output.stamp == later(1500));
}
