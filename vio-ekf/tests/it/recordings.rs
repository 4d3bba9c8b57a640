//! Calibration files and the tables of ASL folders: what was printed by others is read, what we write is read back, and
//! what is wrong is named.

use crate::support::recorded;
use crate::support::rng::Rng;
use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use vio_ekf::camera::Distortion;
use vio_ekf::filter::Calibration;
use vio_ekf::format::calibration::{
    CameraCalibration, ImuCalibration, read_asl_camera, read_asl_imu, read_kalibr_cameras, read_kalibr_imu,
    write_asl_camera, write_asl_imu,
};
use vio_ekf::format::{asl, euroc, kitti, tum};
use vio_ekf::inertial::{InitialSigma, InitialState};
use vio_ekf::{Camera, Error, Imu, ImuNoise, Settings, Stamp, Trajectory, Vio};

const KALIBR: &str = "%YAML:1.0
cam0:
  T_cam_imu: # from the inertial sensor
    - [0.0, -1.0, 0.0, 0.25]
    - [1.0, 0.0, 0.0, 0.0]
    - [0.0, 0.0, 1.0, -0.5]
    - [0.0, 0.0, 0.0, 1.0]
  cam_overlaps: [1]
  camera_model: pinhole
  distortion_coeffs: [0.1, -0.2,
      0.003, 4e-4]
  distortion_model: equidistant
  intrinsics: [190.5, 191, 254, 256.5]
  resolution: [512, 511]
  rostopic: /cam0/image_raw#1
  timeshift_cam_imu: -0.0125
cam1:
  T_imu_cam:
  - [1, 0, 0, 1]
  - [0, 1, 0, 2]
  - [0, 0, 1, 3]
  - [0, 0, 0, 1]
  camera_model: pinhole
  distortion_coeffs: [0, 0, 0, 0]
  distortion_model: radtan
  intrinsics: [1, 2, 3, 4]
  resolution: [5, 6]
";

#[test]
fn kalibr_chains_are_read() {
    let [first, second] = read_kalibr_cameras(KALIBR).unwrap()[..] else { panic!("two cameras") };
    let c = first.camera;
    assert_eq!((c.width, c.height, c.fx, c.cy), (512, 511, 190.5, 256.5));
    assert_eq!(c.distortion, Distortion::Equidistant([0.1, -0.2, 0.003, 4e-4]));
    assert_eq!(first.time_offset_s, -0.0125);
    // The camera's centre: R p + t = 0 with R a quarter turn about z.
    let centre = c.body_from_camera.translation.vector;
    assert!((centre - Vector3::new(0.0, 0.25, 0.5)).norm() < 1e-12, "{centre}");
    // The camera's x is the body's -y.
    assert!((c.body_from_camera * Vector3::x() + Vector3::y()).norm() < 1e-12);
    assert_eq!(second.camera.body_from_camera.translation.vector, Vector3::new(1.0, 2.0, 3.0));
    assert_eq!(second.time_offset_s, 0.0);
    let imu = read_kalibr_imu(
        "imu0:\n  accelerometer_noise_density: 2e-3\n  accelerometer_random_walk: 3e-3\n#  update_rate: 1 # old\n  \
         gyroscope_noise_density: 1.7e-4\n  gyroscope_random_walk: 1.9e-5 # rad\n  update_rate: 200.0\n",
    )
    .unwrap();
    let noise = ImuNoise { gyro_density: 1.7e-4, gyro_walk: 1.9e-5, accel_density: 2e-3, accel_walk: 3e-3 };
    assert_eq!((imu.noise, imu.rate_hz, imu.body_from_imu), (noise, 200.0, Isometry3::identity()));
}

/// The calibration that a filter of one camera starts with.
fn calibration_of(cameras: &[CameraCalibration], imu: &ImuCalibration, settings: &Settings) -> Calibration {
    let mut vio = Vio::from_calibration(cameras, imu, *settings).unwrap();
    let stamp = Stamp::from_nanos(7);
    vio.imu(&Imu { stamp, gyro: Vector3::zeros(), accel: Vector3::new(0.0, 0.0, 9.81) }).unwrap();
    vio.initialize(&InitialState {
        stamp,
        world_from_body: Isometry3::identity(),
        velocity_in_body: Vector3::zeros(),
        gyro_bias: Vector3::zeros(),
        accel_bias: Vector3::zeros(),
        sigma: InitialSigma::default(),
    })
    .unwrap();
    vio.calibration().unwrap()
}

#[test]
fn kalibr_files_make_a_filter_in_one_call() {
    let cameras = read_kalibr_cameras(KALIBR).unwrap();
    let body_from_imu = Isometry3::new(Vector3::new(0.3, 0.0, -0.1), Vector3::new(0.0, 0.2, 0.0));
    let imu = ImuCalibration { noise: ImuNoise::default(), rate_hz: 200.0, body_from_imu };
    let mut settings = Settings::default();
    settings.calibration.time_offset_s = 0.5;
    let found = calibration_of(&cameras[..1], &imu, &settings);
    // The chain's -0.0125 s and the caller's own 0.5 s.
    assert!((found.time_offset_s - 0.4875).abs() < 1e-15, "{}", found.time_offset_s);
    // A point of the camera seen from the body and from the sensor on it.
    let in_camera = nalgebra::Point3::new(0.4, -0.1, 2.0);
    let in_body = cameras[0].camera.body_from_camera * in_camera;
    assert!((body_from_imu * (found.body_from_camera * in_camera) - in_body).norm() < 1e-12);
    for wrong in [&cameras[..0], &[cameras[0]; 3]] {
        assert!(matches!(
            Vio::from_calibration(wrong, &imu, settings),
            Err(Error::InvalidSetting { name: "cameras", .. })
        ));
    }
}

/// What a file says of a clock is good to a millisecond, and as good as the caller says if he does.
#[test]
fn the_clock_of_a_file_is_estimated_unless_it_is_called_exact() {
    let cameras = read_kalibr_cameras(KALIBR).unwrap();
    let imu = ImuCalibration { noise: ImuNoise::default(), rate_hz: 200.0, body_from_imu: Isometry3::identity() };
    for (said, expected) in [(None, 1e-3), (Some(2e-4), 2e-4), (Some(0.01), 0.01), (Some(0.0), 0.0)] {
        let mut settings = Settings::default();
        settings.calibration.time_offset_sigma_s = said;
        let found = calibration_of(&cameras[..1], &imu, &settings).covariance[(6, 6)].sqrt();
        assert!((found - expected).abs() < 1e-15, "{said:?}: {found}");
    }
}

#[test]
fn what_is_written_is_read_back() {
    let body_from_camera =
        Isometry3::from_parts(Vector3::new(0.1, -0.2, 0.3).into(), UnitQuaternion::from_euler_angles(0.3, -1.0, 2.0));
    for distortion in [Distortion::RadTan([-0.28, 0.07, 1.9e-4, 1.7e-5]), Distortion::Equidistant([0.1, 0.2, 0.3, 0.4])]
    {
        let camera = Camera { distortion, body_from_camera, ..Camera::euroc() };
        let calibration = CameraCalibration { camera, rate_hz: Some(20.0), time_offset_s: 0.0, row_time_s: 0.0 };
        let back = read_asl_camera(&write_asl_camera(&calibration)).unwrap();
        assert_eq!((back.camera.distortion, back.camera.fx, back.rate_hz), (distortion, camera.fx, Some(20.0)));
        let error = back.camera.body_from_camera.inverse() * body_from_camera;
        assert!(error.translation.vector.norm() + error.rotation.angle() < 1e-12);
    }
    let imu = ImuCalibration { noise: ImuNoise::default(), rate_hz: 200.0, body_from_imu: Isometry3::identity() };
    assert_eq!(read_asl_imu(&write_asl_imu(&imu)).unwrap(), imu);
    let sample = |k: i64| Imu {
        stamp: Stamp::from_nanos(1_403_636_579_758_555_392 + 5_000_000 * k),
        gyro: Vector3::new(0.1, -1e-17, 0.3),
        accel: Vector3::new(1.0 / 3.0, 0.0, 9.81),
    };
    let samples: Vec<Imu> = (0..3).map(sample).collect();
    assert_eq!(asl::read_imu(&asl::write_imu(&samples)).unwrap(), samples);
    let images = [(Stamp::from_nanos(7), "a.png".to_owned()), (Stamp::from_nanos(9), "b c.png".to_owned())];
    let text = asl::write_images(images.iter().map(|(stamp, name)| (*stamp, name.as_str())));
    assert_eq!(asl::read_images(&text).unwrap(), images);
}

#[test]
fn what_is_wrong_is_named() {
    let has = |error: vio_ekf::Error, words: &[&str]| {
        let text = error.to_string();
        assert!(words.iter().all(|word| text.contains(word)), "{text}");
    };
    let spoilt = |from: &str, to: &str| read_kalibr_cameras(&KALIBR.replacen(from, to, 1)).unwrap_err();
    has(spoilt("[0.0, -1.0, 0.0, 0.25]", "[0.0, -1.1, 0.0, 0.25]"), &["cam0.T_cam_imu", "line 4", "rigid"]);
    has(spoilt("pinhole", "scaramuzza"), &["cam0.camera_model", "line 9", "`scaramuzza`", "pinhole", "CameraModel"]);
    has(spoilt("T_cam_imu", "T_cn_cnm1"), &["cam0.T_cam_imu", "line 3", "camchain-imucam"]);
    has(
        spoilt("  rostopic: /cam0/image_raw#1\n  timeshift_cam_imu: -0.0125\n", "  timeshift_cam_imu: late\n"),
        &["cam0.timeshift_cam_imu", "line 15", "`late`"],
    );
    // The wrong one of Kalibr's files.
    has(
        read_kalibr_cameras("rostopic: /imu0\nupdate_rate: 200\n").unwrap_err(),
        &["cam0", "`rostopic`, `update_rate`"],
    );
    has(read_kalibr_cameras("camera_model: omni\n").unwrap_err(), &["no section `cam0:`", "`camera_model`"]);
    has(read_kalibr_imu(KALIBR).unwrap_err(), &["cam0", "line 3", "inertial sensor"]);
    has(spoilt("equidistant", "fov"), &["distortion_model"]);
    has(spoilt("190.5", "nan"), &["intrinsics", "nan"]);
    has(spoilt("[512, 511]", "[512]"), &["resolution", "2 numbers", "1"]);
    has(spoilt("  resolution: [512, 511]\n", ""), &["cam0.resolution", "line 3", "missing"]);
    // What is not YAML, or not the YAML that is meant: the line, and the format that is expected.
    has(spoilt("0.003, 4e-4]", "0.003, 4e-4"), &["line 12", "Kalibr"]);
    has(spoilt("cam0:", "cam0"), &["line 2", "Kalibr"]);
    has(spoilt("[512, 511]", "{width: 512}"), &["line 14", "Kalibr"]);
    has(spoilt("cam1:", "cam1: 3\ncam2:"), &["line 17", "Kalibr"]);
    has(spoilt("resolution: [512, 511]", "camera_model: pinhole"), &["line 14", "duplicate", "camera_model"]);
    has(read_kalibr_cameras("").unwrap_err(), &["cam0"]);
    has(read_kalibr_imu("").unwrap_err(), &["update_rate", "missing"]);
    has(asl::read_imu("1,0,0,0,0,0,9.8\n0,0,0,0,0,0,9.8\n").unwrap_err(), &["line 2", "sort"]);
    has(asl::read_imu("1,0,0,nan,0,0,9.8\n").unwrap_err(), &["line 1", "column 4"]);
    has(asl::read_imu("1,0,0,0,0,9.8\n").unwrap_err(), &["6 columns"]);
    has(asl::read_images("5,a.png\n5,b.png\n").unwrap_err(), &["line 2", "sort"]);
    assert_eq!(asl::read_imu("1,0,0,0,0,0,9.8\n1,1,1,1,1,1,1\n2,0,0,0,0,0,9.8\n").unwrap().len(), 2);
}

/// `%YAML:1.0` is no directive of YAML, a matrix has a tag of `OpenCV`'s, lists go on over lines, numbers stand in quotes.
#[test]
fn what_opencv_writes_is_read() {
    let text = "\u{feff}%YAML:1.0\n---\nT_BS: !!opencv-matrix\n   rows: 4\n   cols: 4\n   dt: d\n   \
                data: [ 1., 0., 0., 5e-1, 0., 1., 0., 0.,\n       0., 0., 1., -2., 0., 0., 0., 1. ]\nrate_hz: \"200\"\n\
                gyroscope_noise_density: 1.6968e-04 # [ rad / s / sqrt(Hz) ]\ngyroscope_random_walk: 2e-5\n\
                accelerometer_noise_density: 2.0000e-3\naccelerometer_random_walk: .003\n";
    let imu = read_asl_imu(text).unwrap();
    let noise = ImuNoise { gyro_density: 1.6968e-4, gyro_walk: 2e-5, accel_density: 2e-3, accel_walk: 3e-3 };
    assert_eq!((imu.noise, imu.rate_hz), (noise, 200.0));
    assert_eq!(imu.body_from_imu, Isometry3::translation(0.5, 0.0, -2.0));
}

#[test]
fn mutated_calibrations_never_panic() {
    let mut rng = Rng::new(5);
    let mut accepted = 0;
    for _ in 0..5_000 {
        let mut bytes = KALIBR.as_bytes().to_vec();
        for _ in 0..=rng.bits() % 4 {
            let at = rng.bits() as usize % bytes.len().max(1);
            if bytes.is_empty() {
                break;
            }
            match rng.bits() % 3 {
                0 => bytes[at] = b"[]:-,#0 \n9"[rng.bits() as usize % 10],
                1 => drop(bytes.remove(at)),
                _ => bytes.truncate(at + 1),
            }
        }
        let text = String::from_utf8_lossy(&bytes);
        if let Ok(cameras) = read_kalibr_cameras(&text) {
            assert!(cameras.iter().all(|c| c.camera.check().is_ok()));
            accepted += 1;
        }
        let _ = (read_kalibr_imu(&text), read_asl_camera(&text), asl::read_imu(&text), asl::read_images(&text));
    }
    assert!(accepted > 100, "{accepted}");
}

#[test]
fn public_calibrations_are_read() {
    let Some(folder) = recorded::path("vio/calibration/open_vins") else { return };
    let mut cameras = 0;
    for set in std::fs::read_dir(folder).unwrap() {
        let set = set.unwrap().path();
        let text = |name: &str| std::fs::read_to_string(set.join(name)).unwrap();
        let chain = read_kalibr_cameras(&text("kalibr_imucam_chain.yaml"));
        cameras += chain.unwrap_or_else(|error| panic!("{}: {error}", set.display())).len();
        let imu = read_kalibr_imu(&text("kalibr_imu_chain.yaml"));
        imu.unwrap_or_else(|error| panic!("{}: {error}", set.display()));
    }
    assert!(cameras >= 6);
    let Some(micro) = recorded::path("vio/euroc_V1_01_micro/mav0") else { return };
    let text = |name: &str| std::fs::read_to_string(micro.join(name)).unwrap();
    let camera = read_asl_camera(&text("cam0/sensor.yaml")).unwrap();
    let error = camera.camera.body_from_camera.inverse() * Camera::euroc().body_from_camera;
    assert!(error.rotation.angle() < 1e-9 && camera.camera.distortion == Camera::euroc().distortion);
    let right = read_asl_camera(&text("cam1/sensor.yaml")).unwrap().camera;
    let error = right.body_from_camera.inverse() * Camera::euroc_right().body_from_camera;
    assert!(error.rotation.angle() < 1e-9 && error.translation.vector.norm() < 1e-9);
    assert_eq!(Camera { body_from_camera: right.body_from_camera, ..Camera::euroc_right() }, right);
    assert_eq!(read_asl_imu(&text("imu0/sensor.yaml")).unwrap().noise, ImuNoise::default());
    assert_eq!(asl::read_images(&text("cam0/data.csv")).unwrap().len(), 95);
}

/// A circle of 2 m at 0.5 rad/s, 4 s at 50 Hz, nose first.
fn circle() -> Trajectory {
    let mut trajectory = Trajectory::default();
    for k in 0..=200_i64 {
        let angle = 0.5 * k as f64 * 0.02;
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle + std::f64::consts::FRAC_PI_2);
        let place = Vector3::new(2.0 * angle.cos(), 2.0 * angle.sin(), 1.5);
        let stamp = Stamp::from_nanos(1_403_636_579_758_555_392 + 20_000_000 * k);
        trajectory.push(stamp, Isometry3::from_parts(place.into(), turn)).unwrap();
    }
    trajectory
}

/// A recording of our own in every format, on disk: what a stranger's folder holds is read back from files.
#[test]
fn folders_of_our_own_are_read() {
    let root = std::env::temp_dir().join(format!("vio-ekf-formats-{}", std::process::id()));
    let file = |name: &str| root.join(name);
    let put = |name: &str, text: &str| {
        std::fs::create_dir_all(file(name).parent().unwrap()).unwrap();
        std::fs::write(file(name), text).unwrap();
    };
    let get = |name: &str| std::fs::read_to_string(file(name)).unwrap();
    let truth = circle();
    let states = euroc::States { trajectory: truth.clone(), ..Default::default() };
    let samples: Vec<Imu> = truth
        .stamps()
        .iter()
        .map(|stamp| Imu { stamp: *stamp, gyro: Vector3::z() * 0.5, accel: Vector3::new(0.0, 0.5, 9.81) })
        .collect();
    let camera =
        CameraCalibration { camera: Camera::euroc(), rate_hz: Some(20.0), time_offset_s: 0.0, row_time_s: 0.0 };
    let imu = ImuCalibration { noise: ImuNoise::default(), rate_hz: 50.0, body_from_imu: Isometry3::identity() };
    put("mav0/cam0/sensor.yaml", &write_asl_camera(&camera));
    put("mav0/cam0/data.csv", &asl::write_images(truth.stamps().iter().map(|stamp| (*stamp, "0.png"))));
    put("mav0/imu0/sensor.yaml", &write_asl_imu(&imu));
    put("mav0/imu0/data.csv", &asl::write_imu(&samples));
    put("mav0/state_groundtruth_estimate0/data.csv", &euroc::write(&states).unwrap());
    put("groundtruth.txt", &tum::write(&truth));
    put("poses/00.txt", &kitti::write(truth.poses()));
    put("kalibr/camchain-imucam.yaml", KALIBR);

    assert_eq!(read_asl_camera(&get("mav0/cam0/sensor.yaml")).unwrap().camera.distortion, Camera::euroc().distortion);
    assert_eq!(asl::read_images(&get("mav0/cam0/data.csv")).unwrap().len(), 201);
    assert_eq!(read_asl_imu(&get("mav0/imu0/sensor.yaml")).unwrap(), imu);
    assert_eq!(asl::read_imu(&get("mav0/imu0/data.csv")).unwrap(), samples);
    assert_eq!(read_kalibr_cameras(&get("kalibr/camchain-imucam.yaml")).unwrap().len(), 2);
    let in_euroc = euroc::read(&get("mav0/state_groundtruth_estimate0/data.csv")).unwrap().trajectory;
    let in_tum = tum::read(&get("groundtruth.txt")).unwrap();
    let in_kitti = Trajectory::new(truth.stamps().to_vec(), kitti::read(&get("poses/00.txt")).unwrap()).unwrap();
    for read in [in_euroc, in_tum, in_kitti] {
        assert_eq!(read.stamps(), truth.stamps());
        // 200 chords of a circle.
        assert!((read.path_length() - 200.0 * 4.0 * 0.005_f64.sin()).abs() < 1e-9, "{}", read.path_length());
        let turns = read.poses().iter().zip(truth.poses()).map(|(a, b)| a.rotation.angle_to(&b.rotation));
        assert!(turns.fold(0.0, f64::max) < 1e-7);
    }
    std::fs::remove_dir_all(root).unwrap();
}
