//! The filter on images: standing still, starting from it, and light that changes.

use crate::support::flight::{GRAVITY, camera};
use crate::support::rng::Rng;
use nalgebra::{UnitQuaternion, Vector3};
use vio_ekf::filter::InitializationStatus;
use vio_ekf::inertial::{InitialSigma, InitialState};
use vio_ekf::lie::so3;
use vio_ekf::{Camera, ImageView, Imu, ImuNoise, Settings, Stamp, Status, Vio, nalgebra};

const WIDTH: usize = 320;
const HEIGHT: usize = 240;

/// The camera of the flights at less than half the size.
fn small_camera() -> Camera {
    Camera { width: WIDTH, height: HEIGHT, fx: 200.0, fy: 200.0, cx: 160.0, cy: 120.0, ..camera() }
}

/// Grey boxes of all sizes.
fn boxes(seed: u64) -> Vec<u8> {
    let mut rng = Rng::new(seed);
    let mut data = vec![100_u8; WIDTH * HEIGHT];
    for _ in 0..150 {
        let [x, y, w, h, grey] = [WIDTH, HEIGHT, 40, 40, 180].map(|most| (rng.bits() % most as u64) as usize);
        for row in y..(y + h + 4).min(HEIGHT) {
            data[row * WIDTH + x..row * WIDTH + (x + w + 4).min(WIDTH)].fill(grey as u8 + 30);
        }
    }
    data
}

/// The picture as a sensor with gain and noise sees it, moved by whole pixels.
fn seen(data: &[u8], gain: f64, shift: usize, rng: &mut Rng) -> Vec<u8> {
    (0..WIDTH * HEIGHT)
        .map(|k| {
            let from = k / WIDTH * WIDTH + (k % WIDTH + shift) % WIDTH;
            (f64::from(data[from]) * gain + 2.0 * rng.normal()).round().clamp(0.0, 255.0) as u8
        })
        .collect()
}

/// A body at rest.
struct Still {
    attitude: UnitQuaternion<f64>,
    biases: [Vector3<f64>; 2],
    noise: ImuNoise,
    rng: Rng,
}

impl Still {
    fn new(seed: u64) -> Self {
        let mut rng = Rng::new(seed);
        let attitude = so3::exp(&(rng.vector() * 0.4));
        let biases = [rng.vector() * 0.02, rng.vector() * 0.1];
        Self { attitude, biases, noise: ImuNoise::default(), rng }
    }

    fn imu(&mut self, sample: usize) -> Imu {
        let dt = 0.005_f64;
        self.biases[0] += self.rng.normals() * (self.noise.gyro_walk * dt.sqrt());
        self.biases[1] += self.rng.normals() * (self.noise.accel_walk * dt.sqrt());
        let up = self.attitude.inverse() * Vector3::z() * GRAVITY;
        Imu {
            stamp: Stamp::from_nanos(sample as i64 * 5_000_000),
            gyro: self.biases[0] + self.rng.normals() * (self.noise.gyro_density / dt.sqrt()),
            accel: up + self.biases[1] + self.rng.normals() * (self.noise.accel_density / dt.sqrt()),
        }
    }
}

#[test]
fn ten_minutes_at_rest_move_nothing() {
    let mut still = Still::new(4);
    let mut vio = Vio::new(small_camera(), still.noise, Settings::default()).unwrap();
    let picture = boxes(1);
    // Noise of a few images over and over: ten minutes of fresh noise would take longer to make than to filter.
    let images: Vec<_> = (0..16).map(|_| seen(&picture, 1.0, 0, &mut still.rng)).collect();
    let (mut start, mut frames) = (None, 0);
    for sample in 0..10 * 60 * 200 {
        let imu = still.imu(sample);
        vio.imu(&imu).unwrap();
        if sample % 10 == 0 {
            let data = &images[sample / 10 % images.len()];
            let report = vio.image(imu.stamp, &ImageView::new(WIDTH, HEIGHT, data).unwrap()).unwrap();
            if report.status == Status::Tracking {
                frames += 1;
                start.get_or_insert_with(|| vio.output().unwrap());
            }
        }
    }
    let (start, end) = (start.unwrap(), vio.output().unwrap());
    assert!(frames > 11_900, "started late: {frames}");
    let drift = (end.world_from_body.translation.vector - start.world_from_body.translation.vector).norm();
    let turn = so3::angle_between(&start.world_from_body.rotation, &end.world_from_body.rotation);
    let tilt =
        (end.world_from_body.rotation.inverse() * Vector3::z()).angle(&(still.attitude.inverse() * Vector3::z()));
    eprintln!("drift {:.3} mm, {:.4} deg; tilt {:.3} deg", drift * 1e3, turn.to_degrees(), tilt.to_degrees());
    assert!(drift < 5e-3 && turn < 0.1_f64.to_radians());
    // Only the accelerometer's bias, 0.1 m/s² at most, leaves the tilt open.
    assert!(tilt < 0.2 / GRAVITY);
    assert!((end.gyro_bias - still.biases[0]).norm() < 1e-3, "{}", end.gyro_bias - still.biases[0]);
    let error = so3::log(
        &(UnitQuaternion::rotation_between(
            &(end.world_from_body.rotation * (still.attitude.inverse() * Vector3::z())),
            &Vector3::z(),
        )
        .unwrap()),
    );
    for axis in 0..2 {
        let sigma = end.covariance[(6 + axis, 6 + axis)].sqrt();
        assert!(error[axis].abs() < 3.5 * sigma, "tilt {} of {sigma}", error[axis]);
    }
}

#[test]
fn starts_only_from_a_rest_that_it_sees() {
    let run = |scale: f64, shift: usize, picture: &[u8]| {
        let mut still = Still::new(7);
        let mut vio = Vio::new(small_camera(), still.noise, Settings::default()).unwrap();
        for sample in 0..600 {
            let mut imu = still.imu(sample);
            imu.accel *= scale;
            vio.imu(&imu).unwrap();
            if sample % 10 == 0 {
                let data = seen(picture, 1.0, sample / 10 * shift, &mut still.rng);
                vio.image(imu.stamp, &ImageView::new(WIDTH, HEIGHT, &data).unwrap()).unwrap();
            }
        }
        vio.status()
    };
    assert_eq!(run(1.0, 0, &boxes(2)), Status::Tracking);
    // Constant velocity feels like rest to the inertial sensor, but not to the camera.
    assert_ne!(run(1.0, 1, &boxes(2)), Status::Tracking);
    // Nothing to see, nothing to know.
    assert_eq!(run(1.0, 0, &vec![90; WIDTH * HEIGHT]), Status::Uninitialised(InitializationStatus::WaitingForFeatures));
    // Readings in units of g.
    assert_eq!(run(1.0 / GRAVITY, 0, &boxes(2)), Status::Uninitialised(InitializationStatus::GravityMismatch));
}

/// A filter that knows its state, and that measures every image because standing still is not recognised.
fn initialized(still: &mut Still, settings: &Settings) -> Vio {
    let stationary = vio_ekf::filter::StationarySettings { min_duration_s: f64::INFINITY, ..Default::default() };
    let mut vio = Vio::new(small_camera(), still.noise, Settings { stationary, ..*settings }).unwrap();
    vio.imu(&still.imu(0)).unwrap();
    vio.initialize(&vio_ekf::inertial::InitialState {
        stamp: Stamp::from_nanos(0),
        world_from_body: nalgebra::Isometry3::from_parts(Vector3::zeros().into(), still.attitude),
        velocity_in_body: Vector3::zeros(),
        gyro_bias: still.biases[0],
        accel_bias: still.biases[1],
        sigma: vio_ekf::inertial::InitialSigma::default(),
    })
    .unwrap();
    vio
}

#[test]
fn light_that_changes_does_not_look_like_motion() {
    let mut still = Still::new(11);
    let mut vio = initialized(&mut still, &Settings::default());
    let picture = boxes(3);
    let (mut used, mut rejected) = (0, 0);
    for sample in 1..400 {
        let imu = still.imu(sample);
        vio.imu(&imu).unwrap();
        if sample % 10 == 0 {
            // Half the light from one image to the next, and back; then, for half a second, none at all.
            let light = if sample / 10 % 8 < 4 { 1.0 } else { 0.5 };
            let dark = (200..300).contains(&sample);
            let data = seen(&picture, if dark { 0.0 } else { light }, 0, &mut still.rng);
            let report = vio.image(imu.stamp, &ImageView::new(WIDTH, HEIGHT, &data).unwrap()).unwrap();
            assert_eq!(report.status, if dark { Status::DeadReckoning } else { Status::Tracking });
            if dark {
                assert_eq!(report.used, 0, "seen in the dark");
            } else {
                used += report.used;
                rejected += report.rejected;
            }
        }
    }
    let end = vio.output().unwrap();
    assert!(used > 500 && rejected * 20 < used, "{used} used, {rejected} rejected");
    assert!(end.world_from_body.translation.vector.norm() < 0.03, "{}", end.world_from_body.translation.vector);
    assert!(so3::angle_between(&end.world_from_body.rotation, &still.attitude) < 0.005);
}

#[test]
fn nothing_is_tracked_where_the_image_is_masked() {
    // The left half of the image is hidden from the fifth of twenty images on, with landmarks in it by then.
    let mut still = Still::new(5);
    let mut vio = initialized(&mut still, &Settings::default());
    let picture = boxes(8);
    for sample in 1..=200 {
        let imu = still.imu(sample);
        vio.imu(&imu).unwrap();
        if sample % 10 != 0 {
            continue;
        }
        if sample == 50 {
            let mask: Vec<u8> = (0..WIDTH * HEIGHT).map(|k| if k % WIDTH < WIDTH / 2 { 0 } else { 255 }).collect();
            vio.set_mask(&ImageView::new(WIDTH, HEIGHT, &mask).unwrap()).unwrap();
        }
        let data = seen(&picture, 1.0, 0, &mut still.rng);
        vio.image(imu.stamp, &ImageView::new(WIDTH, HEIGHT, &data).unwrap()).unwrap();
        let landmarks: Vec<_> = vio.landmarks().collect();
        let hidden = landmarks.iter().filter(|landmark| landmark.pixel.unwrap().x < WIDTH as f64 / 2.0 - 0.5).count();
        assert!(landmarks.len() >= 10, "image {sample}: {}", landmarks.len());
        assert_eq!(hidden > 0, sample < 50, "image {sample}: {hidden} of {}", landmarks.len());
        for landmark in landmarks {
            // Nothing moves: all that is known of the distance is the prior.
            let settings = Settings::default().landmarks;
            assert!((landmark.inverse_distance - settings.inverse_distance).abs() < settings.inverse_distance);
            assert!(landmark.inverse_distance_sigma > 0.1 * settings.inverse_distance, "{landmark:?}");
            let pixel = small_camera().project(&landmark.bearing_in_camera).unwrap();
            assert!((pixel - landmark.pixel.unwrap()).norm() < 1e-12);
        }
    }
    let small = ImageView { width: 4, height: 4, data: &[0; 16] };
    assert!(matches!(vio.set_mask(&small), Err(vio_ekf::Error::ImageSize { .. })));
}

/// The claimed deviation of the position after two seconds at rest, as if it were a hover, by the drift of templates.
fn deviation_at_rest(drift: f64) -> f64 {
    let mut still = Still::new(11);
    let patches = vio_ekf::filter::PatchSettings { template_drift: drift, ..Default::default() };
    let mut vio = initialized(&mut still, &Settings { patches, ..Settings::default() });
    let picture = boxes(3);
    for sample in 1..400 {
        let imu = still.imu(sample);
        vio.imu(&imu).unwrap();
        if sample % 10 == 0 {
            let data = seen(&picture, 1.0, 0, &mut still.rng);
            vio.image(imu.stamp, &ImageView::new(WIDTH, HEIGHT, &data).unwrap()).unwrap();
        }
    }
    vio.output().unwrap().covariance.fixed_view::<3, 3>(0, 0).trace().sqrt()
}

#[test]
fn templates_that_drift_widen_the_covariance() {
    let [none, usual, much] = [0.0, 0.15, 1.0].map(deviation_at_rest);
    assert!(none > 0.0 && usual > 1.003 * none && much > 1.1 * usual, "{none} m, {usual} m, {much} m");
}

/// Corners that are not found again contradict a motion that says where they are. A fast one does not: how far new ones move in the image
/// depends on their distance, which nobody knows.
#[test]
fn what_may_be_anywhere_contradicts_nothing() {
    for (speed, contradict) in [(0.1, true), (12.0, false)] {
        let mut rng = Rng::new(8);
        let mut vio = Vio::new(small_camera(), ImuNoise::default(), Settings::default()).unwrap();
        let at = |millis: i64| Stamp::from_nanos(millis * 1_000_000);
        let sample = |millis| Imu { stamp: at(millis), gyro: Vector3::zeros(), accel: Vector3::z() * GRAVITY };
        vio.imu(&sample(0)).unwrap();
        let world_from_body = nalgebra::Isometry3::identity();
        let velocity_in_body = Vector3::y() * speed;
        let (gyro_bias, accel_bias, sigma) = (Vector3::zeros(), Vector3::zeros(), InitialSigma::default());
        let start = InitialState { stamp: at(0), world_from_body, velocity_in_body, gyro_bias, accel_bias, sigma };
        vio.initialize(&start).unwrap();
        let mut reports = Vec::new();
        for millis in (5..=200).step_by(5) {
            vio.imu(&sample(millis)).unwrap();
            if millis % 100 == 0 {
                let picture = seen(&boxes(millis as u64), 1.0, 0, &mut rng);
                reports.push(vio.image(at(millis), &ImageView::new(WIDTH, HEIGHT, &picture).unwrap()).unwrap());
            }
        }
        assert!(reports[0].added > 15, "{:?}", reports[0]);
        assert_eq!(reports[1].rejected > 10, contradict, "at {speed} m/s: {:?}", reports[1]);
        assert_eq!(reports[1].consecutive_outliers > 0, contradict, "at {speed} m/s: {:?}", reports[1]);
    }
}
