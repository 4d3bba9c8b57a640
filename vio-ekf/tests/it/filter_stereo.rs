//! The filter with a second camera: it knows how far away things are before it has moved.

use crate::support::flight::{Flight, nees};
use nalgebra::{Isometry3, Vector2, Vector3};
use vio_ekf::filter::{PointObservation, PointPair};
use vio_ekf::fusion::{UnifiedSettings, UnifiedVio};
use vio_ekf::inertial::{InitialSigma, InitialState};
use vio_ekf::sim::{RoomSettings, Scenario, SimulatedCamera, Simulation, camera_ahead, camera_ahead_right};
use vio_ekf::trajectory::Spline;
use vio_ekf::{Camera, Error, ImageView, ImuNoise, Odometry, Settings, Stamp, Status, Vio, nalgebra};

/// End of the rest, s; a second later the body moves at 1 m/s.
const TAKE_OFF: f64 = 1.6;
const KNOT_NS: i64 = 50_000_000;

/// Both cameras of the robot that paints, at half the size.
fn cameras() -> [Camera; 2] {
    let half = |camera: Camera| Camera {
        width: camera.width / 2,
        height: camera.height / 2,
        fx: camera.fx / 2.0,
        fy: camera.fy / 2.0,
        cx: camera.cx / 2.0 - 0.25,
        cy: camera.cy / 2.0 - 0.25,
        ..camera
    };
    [half(camera_ahead()), half(camera_ahead_right())]
}

/// A room whose walls are so far away, and a motion sideways through it, given by the way after a time.
fn simulation(wall: f64, way: impl Fn(f64) -> f64) -> Simulation {
    let knots = (0..64).map(|k| Isometry3::translation(0.0, way(f64::from(k) * 0.05 - 0.05), 1.0));
    let spline = Spline::new(Stamp::from_nanos(0), KNOT_NS, knots.collect()).unwrap();
    let room = RoomSettings { wall_distance_m: (wall, wall), furniture: 0, texture_size: 1024, ..Default::default() };
    let cameras = cameras().map(|camera| SimulatedCamera { camera, ..SimulatedCamera::default() }).to_vec();
    Simulation::new(spline, Scenario { seed: 5, room, cameras, ..Scenario::default() }).unwrap()
}

/// The estimates after each image until a time. `pairs` tells of each frame whether the second image comes.
fn fly(simulation: &Simulation, mut vio: Vio, until: f64, pairs: impl Fn(usize) -> bool) -> Vec<Odometry> {
    let recording = simulation.imu(0).unwrap();
    let mut samples = recording.samples.iter().peekable();
    // An estimate that is running was started at the first sample.
    if vio.output().is_some() {
        samples.next();
    }
    let mut estimates = Vec::new();
    for index in 0..simulation.frame_count(0) {
        let frame = simulation.frame(0, index).unwrap().unwrap();
        if frame.stamp.secs_since(simulation.spline().span().0) > until {
            break;
        }
        for sample in samples.by_ref() {
            vio.imu(sample).unwrap();
            if sample.stamp >= frame.stamp {
                break;
            }
        }
        if pairs(index) {
            let second = simulation.frame(1, index).unwrap().unwrap();
            assert_eq!(second.stamp, frame.stamp);
            vio.image_pair(frame.stamp, &frame.view(), &second.view()).unwrap();
        } else {
            vio.image(frame.stamp, &frame.view()).unwrap();
        }
        estimates.extend(vio.output());
        assert!(!matches!(vio.status(), Status::Diverged(_)));
    }
    estimates
}

fn stereo() -> Vio {
    let [first, second] = cameras();
    Vio::stereo(first, second, ImuNoise::default(), Settings::default()).unwrap()
}

/// Standard deviation of the velocity along its worst axis.
fn velocity_sigma(odometry: &Odometry) -> f64 {
    odometry.covariance.fixed_view::<3, 3>(3, 3).into_owned().symmetric_eigenvalues().max().sqrt()
}

#[test]
fn constant_speed_has_a_scale() {
    // What an inertial sensor cannot feel: all speeds fit what one camera sees.
    for wall in [1.5, 6.0] {
        let simulation = simulation(wall, |t| 0.8 * t);
        let recording = simulation.imu(0).unwrap();
        let start = InitialState {
            stamp: recording.samples[0].stamp,
            world_from_body: simulation.motion(recording.samples[0].stamp).unwrap().world_from_body,
            velocity_in_body: Vector3::zeros(),
            gyro_bias: Vector3::zeros(),
            accel_bias: Vector3::zeros(),
            sigma: InitialSigma { velocity: 0.8, ..InitialSigma::default() },
        };
        let fly = |pairs: bool| {
            let mut vio = stereo();
            vio.imu(&recording.samples[0]).unwrap();
            vio.initialize(&start).unwrap();
            *fly(&simulation, vio, 0.6, |_| pairs).last().unwrap()
        };
        let (pair, alone) = (fly(true), fly(false));
        let off = pair.velocity_in_body - Vector3::new(0.0, 0.8, 0.0);
        let sigma = velocity_sigma(&pair);
        eprintln!(
            "wall at {wall} m: velocity off {:.4} of {sigma:.4} m/s; alone {:.4}",
            off.norm(),
            velocity_sigma(&alone)
        );
        assert!(off.norm() < 3.0 * sigma && sigma < 0.04, "wall at {wall} m: {off} of {sigma}");
        assert!(velocity_sigma(&alone) > 2.0 * sigma, "wall at {wall} m: {}", velocity_sigma(&alone));
    }
}

#[test]
fn the_scale_is_known_at_take_off() {
    // Nothing is assumed of the distance: half of what one camera begins with, and twice as much.
    for wall in [1.5, 6.0] {
        let simulation =
            simulation(wall, |t| 0.5 * (t - TAKE_OFF).clamp(0.0, 1.0).powi(2) + (t - TAKE_OFF - 1.0).max(0.0));
        // All pairs, or every other one only.
        for every in [1, 2] {
            let estimates = fly(&simulation, stereo(), TAKE_OFF + 1.0, |index| index % every == 0);
            let truth = |odometry: &Odometry| simulation.motion(odometry.stamp).unwrap().world_from_body;
            // From when it is seen that the rest is over.
            let [end, from] = [1, 13].map(|back| estimates[estimates.len() - back]);
            let way = |a: Isometry3<f64>, b: Isometry3<f64>| (a.translation.vector - b.translation.vector).norm();
            let scale = way(end.world_from_body, from.world_from_body) / way(truth(&end), truth(&from));
            let sigma = velocity_sigma(&end);
            eprintln!("wall at {wall} m, {every}: scale {scale:.4}, {sigma:.4} m/s");
            assert!((scale - 1.0).abs() < 0.03 && sigma < 0.02, "wall at {wall} m, every {every}: {scale}, {sigma}");
        }
    }
}

/// Pairs through the estimator that puts measurements in order: late by half of what it waits, or not, nothing changes.
#[test]
fn pairs_that_arrive_late_change_no_bit() {
    let fly = |late: usize| {
        let mut flight = Flight::new(3, 3.0);
        let start = flight.drawn_start(InitialSigma::default());
        let mut right = flight.camera;
        right.body_from_camera.translation.y -= 0.11;
        let settings = UnifiedSettings { imu: flight.noise, ..UnifiedSettings::default() };
        let mut vio = UnifiedVio::stereo(flight.camera, right, Settings::default(), settings).unwrap();
        let mut waiting: Vec<(usize, Stamp, Vec<PointPair>)> = Vec::new();
        let last = flight.spline.span().1;
        for (k, stamp) in flight.stamps().enumerate() {
            vio.imu(&flight.imu(stamp)).unwrap();
            if k == 0 {
                vio.initialize(&start).unwrap();
            } else if k % 10 == 0 && stamp < last {
                let camera_from_world = (flight.truth(stamp).world_from_body * right.body_from_camera).inverse();
                let seen = flight.see(stamp);
                let pair = |first: PointObservation| {
                    let local = camera_from_world * nalgebra::Point3::from(flight.points[first.id as usize]);
                    PointPair { first, second: right.project(&local.coords) }
                };
                waiting.push((k + late, stamp, seen.into_iter().map(pair).collect()));
            }
            for (_, stamp, pairs) in waiting.extract_if(.., |(due, ..)| *due <= k) {
                vio.point_pairs(stamp, &pairs).unwrap();
            }
        }
        assert!(vio.last_frame().unwrap().used > 10 && vio.counts().too_late == 0, "{:?}", vio.counts());
        vio.output().unwrap()
    };
    assert_eq!(fly(0), fly(10));
    let forward = vio_ekf::sim::forward_pinhole();
    let mut alone = UnifiedVio::new(forward, Settings::default(), UnifiedSettings::default()).unwrap();
    assert!(matches!(alone.point_pairs(Stamp::default(), &[]), Err(Error::NoSuch { what: "camera", index: 1, .. })));
}

/// Mean squared error of a flight through a room of points, each with a pixel of noise in both images.
fn square_on_points(seed: u64, pairs: bool, sums: &mut [f64; 5]) -> f64 {
    let mut flight = Flight::new(seed, 12.0);
    let start = flight.drawn_start(InitialSigma::default());
    let mut right = flight.camera;
    right.body_from_camera.translation.y -= 0.11;
    let mut vio = Vio::stereo(flight.camera, right, flight.noise, Settings::default()).unwrap();
    let (mut square, mut count) = (0.0, 0.0);
    let (stamps, last): (Vec<Stamp>, Stamp) = (flight.stamps().collect(), flight.spline.span().1);
    let frames = stamps.iter().skip(1).filter(|stamp| **stamp < last).count() as f64 / 10.0;
    for (k, stamp) in stamps.into_iter().enumerate() {
        vio.imu(&flight.imu(stamp)).unwrap();
        if k == 0 {
            vio.initialize(&start).unwrap();
        } else if k % 10 == 0 && stamp < last {
            let seen = flight.see(stamp);
            if pairs {
                let camera_from_world = (flight.truth(stamp).world_from_body * right.body_from_camera).inverse();
                let pair = |first: PointObservation| {
                    let local = camera_from_world * nalgebra::Point3::from(flight.points[first.id as usize]);
                    let noise = Vector2::new(flight.rng.normal(), flight.rng.normal()) * flight.pixel_sigma;
                    PointPair { first, second: right.project(&local.coords).map(|pixel| pixel + noise) }
                };
                let pairs: Vec<PointPair> = seen.into_iter().map(pair).collect();
                vio.point_pairs(stamp, &pairs).unwrap();
            } else {
                vio.points(stamp, &seen).unwrap();
            }
            let (odometry, truth) = (vio.output().unwrap(), flight.truth(stamp));
            let off = truth.world_from_body.translation.vector - odometry.world_from_body.translation.vector;
            square += off.norm_squared();
            count += 1.0;
            for (sum, value) in sums.iter_mut().zip(nees(&odometry, &truth, &flight.biases)) {
                *sum += value / frames;
            }
        }
    }
    square / count
}

#[test]
fn points_of_both_cameras_are_better_than_those_of_one() {
    let runs = 8;
    let (mut sums, mut others) = ([0.0; 5], [0.0; 5]);
    let error = |pairs: bool, sums: &mut [f64; 5]| {
        ((1..=runs).map(|seed| square_on_points(seed, pairs, sums)).sum::<f64>() / runs as f64).sqrt()
    };
    let (pair, alone) = (error(true, &mut sums), error(false, &mut others));
    let [mean, other] = [sums, others].map(|sums| sums.map(|sum| sum / runs as f64));
    eprintln!("{pair:.4} m with pairs, {alone:.4} m alone; NEES {mean:.2?}, {other:.2?}");
    assert!(pair < 0.8 * alone && mean.iter().all(|m| (1.5..4.5).contains(m)), "{pair} {alone} {mean:?}");
}

#[test]
fn points_of_a_wrong_pair_are_refused() {
    let point = |x: f64| PointObservation { id: 1, pixel: Vector2::new(x, 50.0) };
    let pair = |x: f64, y: f64| PointPair { first: point(x), second: Some(Vector2::new(90.0, y)) };
    let stamp = Stamp::from_nanos(0);
    let mut vio = stereo();
    for bad in [pair(f64::NAN, 50.0), pair(80.0, f64::INFINITY)] {
        assert!(matches!(vio.point_pairs(stamp, &[pair(80.0, 50.0), bad]), Err(Error::NonFinite { index: 1, .. })));
    }
    assert!(vio.point_pairs(stamp, &[pair(80.0, 50.0)]).is_ok());
    let mut alone = Vio::new(cameras()[0], ImuNoise::default(), Settings::default()).unwrap();
    assert!(matches!(alone.point_pairs(stamp, &[]), Err(Error::NoSuch { what: "camera", index: 1, .. })));
}

#[test]
fn images_of_a_wrong_pair_are_refused() {
    let [first, second] = cameras();
    let grey = vec![90; first.width * first.height];
    let view = ImageView::new(first.width, first.height, &grey).unwrap();
    let small = ImageView::new(first.width, first.height - 1, &grey[first.width..]).unwrap();
    let stamp = Stamp::from_nanos(0);
    let mut vio = stereo();
    for (one, other) in [(&small, &view), (&view, &small)] {
        assert!(matches!(vio.image_pair(stamp, one, other), Err(Error::ImageSize { .. })));
    }
    assert!(vio.image_pair(stamp, &view, &view).is_ok());
    let mut alone = Vio::new(first, ImuNoise::default(), Settings::default()).unwrap();
    assert!(matches!(alone.image_pair(stamp, &view, &view), Err(Error::NoSuch { what: "camera", index: 1, .. })));

    let refused = |second: Camera, settings: Settings| Vio::stereo(first, second, ImuNoise::default(), settings).err();
    let bad = Camera { fx: f64::NAN, ..second };
    assert!(matches!(refused(bad, Settings::default()), Some(Error::InvalidSetting { name: "fx", .. })));
    // Without a base nothing can be measured.
    assert!(matches!(refused(first, Settings::default()), Some(Error::InvalidSetting { name: "baseline", .. })));
    for change in [
        |settings: &mut Settings| settings.stereo.pixel_sigma = 0.0,
        |settings: &mut Settings| settings.stereo.min_distance_m = f64::NAN,
        |settings: &mut Settings| settings.stereo.uniqueness_ratio = 0.5,
    ] {
        let mut settings = Settings::default();
        change(&mut settings);
        assert!(matches!(refused(second, settings), Some(Error::InvalidSetting { .. })));
    }
}
