//! What the fusion of poses does with input that is wrong, missing, singular or late.

use crate::support::flight::Flight;
use crate::support::rng::Rng;
use crate::support::tracker::Tracker;
use nalgebra::{Isometry3, Matrix6, Translation3, Vector3, Vector6};
use vio_ekf::fusion::{FusionSettings, PoseFusion, PoseMeasurement, PoseSource};
use vio_ekf::inertial::{DivergenceCause, InitialSigma, InitialState};
use vio_ekf::lie::so3;
use vio_ekf::{Error, Imu, Stamp, nalgebra};

#[test]
fn outliers_are_refused_and_a_source_that_is_wrong_is_told() {
    let rmse = |share: u64| {
        let mut flight = Flight::new(4, 12.0);
        let source = Tracker::default();
        let start = flight.drawn_start(InitialSigma { position: 0.05, yaw: 0.02, ..InitialSigma::default() });
        let mut fusion = PoseFusion::new(flight.noise, &[source.known()], FusionSettings::default()).unwrap();
        let mut luck = Rng::new(99);
        let (mut sum, mut count, mut refused) = (0.0, 0, 0);
        for (k, stamp) in flight.stamps().enumerate() {
            fusion.imu(&flight.imu(stamp)).unwrap();
            if k == 0 {
                fusion.initialize(&start).unwrap();
            } else if k % 10 == 0 {
                let mut pose = source.pose(&mut flight, stamp);
                if luck.bits() % 100 < share {
                    let wrong = Isometry3::new(luck.vector() * 2.0, luck.vector());
                    pose.source_from_sensor = wrong * pose.source_from_sensor;
                }
                fusion.pose(&pose).unwrap();
                refused += u32::from(fusion.consecutive_outliers() > 0);
                let truth = flight.truth(stamp).world_from_body.translation.vector;
                sum += (fusion.output().unwrap().world_from_body.translation.vector - truth).norm_squared();
                count += 1;
            }
        }
        assert_eq!(fusion.diverged(), None);
        (f64::sqrt(sum / f64::from(count)), refused)
    };
    let ((clean, none), (dirty, some)) = (rmse(0), rmse(20));
    eprintln!("{clean:.4} m, with a fifth wrong {dirty:.4} m, {some} refused");
    assert!(none <= 2 && (30..70).contains(&some), "{none}, {some}");
    assert!(dirty < 1.3 * clean && clean < 0.02, "{clean}, {dirty}");

    // Ten in a row, and the estimate is given up; a new start takes it back.
    let mut flight = Flight::new(4, 2.0);
    let source = Tracker::default();
    let start = flight.drawn_start(InitialSigma::default());
    let mut fusion = PoseFusion::new(flight.noise, &[source.known()], FusionSettings::default()).unwrap();
    for (k, stamp) in flight.stamps().enumerate().take(250) {
        fusion.imu(&flight.imu(stamp)).unwrap();
        if k == 0 {
            fusion.initialize(&start).unwrap();
        } else if k % 10 == 0 {
            let mut pose = source.pose(&mut flight, stamp);
            pose.source_from_sensor.translation.vector.z += 1.0;
            fusion.pose(&pose).unwrap();
            assert_eq!(fusion.diverged().is_some(), k >= 100, "sample {k}");
        }
    }
    assert_eq!(fusion.diverged(), Some(DivergenceCause::ConsecutiveOutliers));
    let again = InitialState { stamp: Stamp::from_nanos(start.stamp.nanos() + 2_000_000_000), ..start };
    fusion.initialize(&again).unwrap();
    assert_eq!((fusion.diverged(), fusion.consecutive_outliers()), (None, 0));
}

#[test]
fn without_poses_it_says_when_it_knows_nothing_any_more() {
    let mut flight = Flight::new(2, 30.0);
    let start = flight.drawn_start(InitialSigma::default());
    let mut fusion = PoseFusion::new(flight.noise, &[PoseSource::default()], FusionSettings::default()).unwrap();
    let mut told = None;
    for (k, stamp) in flight.stamps().enumerate() {
        fusion.imu(&flight.imu(stamp)).unwrap();
        if k == 0 {
            fusion.initialize(&start).unwrap();
        }
        let output = fusion.output().unwrap();
        assert!(output.covariance.iter().all(|v| v.is_finite()));
        if told.is_none() && fusion.diverged().is_some() {
            told = Some(output.covariance.fixed_view::<3, 3>(3, 3).diagonal().max().sqrt());
        }
    }
    // One metre per second, looked at every 32 samples.
    assert_eq!(fusion.diverged(), Some(DivergenceCause::Uncertainty));
    assert!((0.95..1.2).contains(&told.unwrap()), "{told:?}");
}

#[test]
fn a_direction_without_information_is_not_believed() {
    // A scan laid against a wall: nothing about y, z and the turn about x. The shifts there are nonsense.
    let flight = Flight::new(3, 1.0);
    let start = InitialState {
        stamp: Stamp::from_nanos(0),
        world_from_body: Isometry3::identity(),
        velocity_in_body: Vector3::zeros(),
        gyro_bias: Vector3::zeros(),
        accel_bias: Vector3::zeros(),
        sigma: InitialSigma { position: 0.1, yaw: 0.1, ..InitialSigma::default() },
    };
    let mut fusion = PoseFusion::new(flight.noise, &[PoseSource::default()], FusionSettings::default()).unwrap();
    let imu =
        |k: i64| Imu { stamp: Stamp::from_nanos(k * 5_000_000), gyro: Vector3::zeros(), accel: Vector3::z() * 9.81 };
    fusion.imu(&imu(0)).unwrap();
    fusion.initialize(&start).unwrap();
    fusion.imu(&imu(1)).unwrap();
    let before = fusion.output().unwrap();
    let information = Matrix6::from_diagonal(&Vector6::new(1e8, 0.0, 0.0, 0.0, 1e8, 1e8));
    let residual = Vector6::new(0.05, 1e3, -1e3, 1e-4, 0.01, 0.05);
    let stamp = imu(1).stamp;
    fusion.pose(&PoseMeasurement::from_residual(0, stamp, before.world_from_body, &residual, information)).unwrap();
    let after = fusion.output().unwrap();
    assert_eq!(fusion.consecutive_outliers(), 0);
    let position = after.world_from_body.translation.vector;
    assert!((position - Vector3::new(0.05, 0.0, 0.0)).norm() < 1e-3, "{position}");
    let turn = so3::log(&after.world_from_body.rotation);
    assert!((turn - Vector3::new(0.0, 0.01, 0.05)).norm() < 1e-3, "{turn}");
    for (row, sigma) in [(0, 1e-4), (1, 0.1), (2, 0.1), (6, 0.01), (7, 1e-4), (8, 1e-4)] {
        let ours = after.covariance[(row, row)].sqrt();
        assert!((ours / sigma - 1.0).abs() < 0.05, "row {row}: {ours}");
    }
}

#[test]
fn refuses_what_it_cannot_use() {
    let mut flight = Flight::new(1, 4.0);
    let (noise, settings) = (flight.noise, FusionSettings::default());
    let source = Tracker::default();
    let known = source.known();
    assert!(matches!(PoseFusion::new(noise, &[], settings), Err(Error::InvalidSetting { name: "sources", .. })));
    for (bad, what) in [
        (PoseSource { scale: 0.0, ..known }, "scale"),
        (PoseSource { scale_sigma: -1.0, ..known }, "scale_sigma"),
        (PoseSource { time_offset_s: f64::NAN, ..known }, "time_offset_s"),
    ] {
        let refused = PoseFusion::new(noise, &[bad], settings);
        assert!(matches!(refused, Err(Error::InvalidSetting { name, .. }) if name == what), "{what}");
    }
    for bad in [
        FusionSettings { gravity: 0.0, ..settings },
        FusionSettings { max_mahalanobis: f64::NAN, ..settings },
        FusionSettings { max_iterations: 0, ..settings },
        FusionSettings { buffer_samples: 1, ..settings },
        FusionSettings { buffer_poses: 1_000_000, ..settings },
    ] {
        assert!(matches!(PoseFusion::new(noise, &[known], bad), Err(Error::InvalidSetting { .. })), "{bad:?}");
    }

    let mut fusion = PoseFusion::new(noise, &[known], settings).unwrap();
    let start = flight.drawn_start(InitialSigma::default());
    assert!(matches!(fusion.initialize(&start), Err(Error::TooFew { .. })));
    assert!(fusion.output().is_none() && fusion.source_estimate(0).is_none());
    let first = flight.first();
    let at = |ms: i64| Stamp::from_nanos(first.nanos() + ms * 1_000_000);
    let sample = flight.imu(first);
    let nan = Vector3::new(0.0, f64::NAN, 0.0);
    assert!(matches!(fusion.imu(&Imu { accel: nan, ..sample }), Err(Error::NonFinite { .. })));
    fusion.imu(&sample).unwrap();
    assert!(matches!(fusion.imu(&sample), Err(Error::NotIncreasing { .. })));
    assert!(matches!(fusion.initialize(&InitialState { stamp: at(-5), ..start }), Err(Error::Late { .. })));
    assert!(matches!(fusion.initialize(&InitialState { gyro_bias: nan, ..start }), Err(Error::NonFinite { .. })));
    fusion.initialize(&start).unwrap();
    for k in 1..=20 {
        fusion.imu(&flight.imu(at(5 * k))).unwrap();
    }
    let good = source.pose(&mut flight, at(50));
    let lopsided = {
        let mut information = good.information;
        information[(0, 1)] = 1e3;
        information
    };
    for (bad, what) in [
        (PoseMeasurement { source: 1, ..good }, "source"),
        (PoseMeasurement { source_from_sensor: Translation3::from(nan) * good.source_from_sensor, ..good }, "pose"),
        (PoseMeasurement { information: good.information * f64::INFINITY, ..good }, "infinite"),
        (PoseMeasurement { information: -good.information, ..good }, "negative"),
        (PoseMeasurement { information: lopsided, ..good }, "lopsided"),
        (PoseMeasurement { stamp: at(300), ..good }, "ahead"),
        (PoseMeasurement { stamp: at(-1), ..good }, "before the start"),
        (PoseMeasurement { stamp: Stamp::from_nanos(i64::MAX), ..good }, "end of time"),
    ] {
        let before = fusion.output();
        assert!(fusion.pose(&bad).is_err(), "{what}");
        assert_eq!(fusion.output(), before, "{what}");
    }
    fusion.pose(&good).unwrap();
    assert!(matches!(fusion.pose(&good), Err(Error::NotIncreasing { .. })));
    // What is older than the history is settled, poses or not.
    for k in 21..=600 {
        fusion.imu(&flight.imu(at(5 * k))).unwrap();
    }
    let old = source.pose(&mut flight, at(1_000));
    assert!(matches!(fusion.pose(&old), Err(Error::Late { what: "pose", .. })));
    let recent = source.pose(&mut flight, at(2_000));
    fusion.pose(&recent).unwrap();
}

#[test]
fn a_pose_says_where_the_body_is() {
    let mut flight = Flight::new(6, 1.0);
    let source = Tracker {
        source_from_world: Isometry3::new(Vector3::new(3.0, -2.0, 1.0), Vector3::new(0.1, 0.2, 0.8)),
        scale: 1.3,
        position_sigma: 1e-9,
        attitude_sigma: 1e-9,
        ..Tracker::default()
    };
    let fusion = PoseFusion::new(flight.noise, &[source.known()], FusionSettings::default()).unwrap();
    let first = flight.first();
    let pose = source.pose(&mut flight, first);
    let (body, truth) = (fusion.body_at(&pose).unwrap(), flight.truth(first).world_from_body);
    assert!((body.translation.vector - truth.translation.vector).norm() < 1e-7);
    assert!(so3::angle_between(&body.rotation, &truth.rotation) < 1e-7);
    assert!(matches!(fusion.body_at(&PoseMeasurement { source: 3, ..pose }), Err(Error::NoSuch { .. })));
}
