//! Calibrations: the `sensor.yaml` of EuRoC/ASL folders, and the camera and inertial chains that Kalibr writes.
//!
//! The files say the same in different words: EuRoC's `T_BS` and Kalibr's `T_imu_cam` are `body_from_camera`, Kalibr's
//! `T_cam_imu` is its inverse; the body is the inertial sensor.

use nalgebra::Isometry3;

use super::yaml::Document;
use crate::camera::nearest_pose;
use crate::{Camera, Distortion, Error, ImuNoise};

/// Rotations are printed with few digits in some files; more than this off is not a rotation.
const ROTATION_TOLERANCE: f64 = 1e-3;

/// A camera with its clock.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraCalibration {
    /// Lens and place on the body.
    pub camera: Camera,
    /// Frames per second, where the file says.
    pub rate_hz: Option<f64>,
    /// What is added to a stamp of the camera to get the inertial sensor's time (`timeshift_cam_imu`), s; 0 where the
    /// file does not say.
    pub time_offset_s: f64,
}

/// An inertial sensor with its noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImuCalibration {
    /// Continuous-time noise densities.
    pub noise: ImuNoise,
    /// Samples per second.
    pub rate_hz: f64,
    /// Pose of the sensor on the body; identity where the file does not say.
    pub body_from_imu: Isometry3<f64>,
}

/// Reads the `sensor.yaml` of an EuRoC/ASL camera.
pub fn read_asl_camera(text: &str) -> Result<CameraCalibration, Error> {
    let document = Document::read(text)?;
    let body_from_camera = pose(&document, "T_BS.data")?;
    let camera = camera(&document, "", "distortion_coefficients", body_from_camera)?;
    Ok(CameraCalibration { camera, rate_hz: document.optional("rate_hz")?, time_offset_s: 0.0 })
}

/// Reads the `sensor.yaml` of an EuRoC/ASL inertial sensor.
pub fn read_asl_imu(text: &str) -> Result<ImuCalibration, Error> {
    let document = Document::read(text)?;
    let [rate_hz] = document.numbers("rate_hz")?;
    imu(&document, "", rate_hz, pose(&document, "T_BS.data")?)
}

/// Reads the cameras `cam0`, `cam1` ... of a Kalibr camera chain.
pub fn read_kalibr_cameras(text: &str) -> Result<Vec<CameraCalibration>, Error> {
    let document = Document::read(text)?;
    let mut cameras = Vec::new();
    for name in document.top().filter(|name| name.starts_with("cam")) {
        let prefix = format!("{name}.");
        let from_imu = format!("{name}.T_cam_imu");
        let body_from_camera = if document.has(&from_imu) {
            pose(&document, &from_imu)?.inverse()
        } else {
            pose(&document, &format!("{name}.T_imu_cam"))?
        };
        let camera = camera(&document, &prefix, "distortion_coeffs", body_from_camera)?;
        let time_offset_s = document.optional(&format!("{name}.timeshift_cam_imu"))?.unwrap_or(0.0);
        cameras.push(CameraCalibration { camera, rate_hz: None, time_offset_s });
    }
    if cameras.is_empty() {
        return Err(Error::TooFew { what: "cameras (`cam0:` ...) in the Kalibr text", got: 0, need: 1 });
    }
    Ok(cameras)
}

/// Reads the inertial sensor of a Kalibr file: `imu0`, or the bare keys of its input file.
pub fn read_kalibr_imu(text: &str) -> Result<ImuCalibration, Error> {
    let document = Document::read(text)?;
    let prefix = if document.has("imu0") { "imu0." } else { "" };
    let [rate_hz] = document.numbers(&format!("{prefix}update_rate"))?;
    let from_body = format!("{prefix}T_i_b");
    let body_from_imu =
        if document.has(&from_body) { pose(&document, &from_body)?.inverse() } else { Isometry3::identity() };
    imu(&document, prefix, rate_hz, body_from_imu)
}

/// The `sensor.yaml` of an EuRoC/ASL camera. `Distortion::None` becomes a polynomial of zeros, which it equals.
pub fn write_asl_camera(calibration: &CameraCalibration) -> String {
    let camera = &calibration.camera;
    let (model, k) = match camera.distortion {
        Distortion::None => ("radial-tangential", [0.0; 4]),
        Distortion::RadTan(k) => ("radial-tangential", k),
        Distortion::Equidistant(k) => ("equidistant", k),
    };
    let rate = calibration.rate_hz.map_or(String::new(), |rate| format!("rate_hz: {rate}\n"));
    format!(
        "%YAML:1.0\nsensor_type: camera\n{}{rate}resolution: [{}, {}]\ncamera_model: pinhole\n\
         intrinsics: [{}, {}, {}, {}]\ndistortion_model: {model}\ndistortion_coefficients: [{}, {}, {}, {}]\n",
        pose_text(&camera.body_from_camera),
        camera.width,
        camera.height,
        camera.fx,
        camera.fy,
        camera.cx,
        camera.cy,
        k[0],
        k[1],
        k[2],
        k[3]
    )
}

/// The `sensor.yaml` of an EuRoC/ASL inertial sensor.
pub fn write_asl_imu(calibration: &ImuCalibration) -> String {
    let noise = &calibration.noise;
    format!(
        "%YAML:1.0\nsensor_type: imu\n{}rate_hz: {}\ngyroscope_noise_density: {}\ngyroscope_random_walk: {}\n\
         accelerometer_noise_density: {}\naccelerometer_random_walk: {}\n",
        pose_text(&calibration.body_from_imu),
        calibration.rate_hz,
        noise.gyro_density,
        noise.gyro_walk,
        noise.accel_density,
        noise.accel_walk
    )
}

fn camera(
    document: &Document,
    prefix: &str,
    coefficients: &str,
    body_from_camera: Isometry3<f64>,
) -> Result<Camera, Error> {
    let key = |name: &str| format!("{prefix}{name}");
    if document.word(&key("camera_model"))? != "pinhole" {
        return Err(document.refuse(&key("camera_model"), "only `pinhole` is known"));
    }
    let [width, height] = document.numbers(&key("resolution"))?;
    let [fx, fy, cx, cy] = document.numbers(&key("intrinsics"))?;
    let model = key("distortion_model");
    let distortion = match document.word(&model)? {
        "radtan" | "radial-tangential" | "plumb_bob" => Distortion::RadTan(document.numbers(&key(coefficients))?),
        "equidistant" => Distortion::Equidistant(document.numbers(&key(coefficients))?),
        "none" => Distortion::None,
        _ => return Err(document.refuse(&model, "only `radtan`, `radial-tangential`, `equidistant`, `none` are known")),
    };
    if !(1.0..=32768.0).contains(&width) || !(1.0..=32768.0).contains(&height) {
        return Err(document.refuse(&key("resolution"), "must be between 1 and 32768 pixels"));
    }
    let (width, height) = (width as usize, height as usize);
    let camera = Camera { width, height, fx, fy, cx, cy, distortion, body_from_camera };
    camera.check()?;
    Ok(camera)
}

fn imu(
    document: &Document,
    prefix: &str,
    rate_hz: f64,
    body_from_imu: Isometry3<f64>,
) -> Result<ImuCalibration, Error> {
    let number = |name: &str| document.numbers(&format!("{prefix}{name}")).map(|[value]| value);
    let noise = ImuNoise {
        gyro_density: number("gyroscope_noise_density")?,
        gyro_walk: number("gyroscope_random_walk")?,
        accel_density: number("accelerometer_noise_density")?,
        accel_walk: number("accelerometer_random_walk")?,
    };
    noise.check()?;
    if rate_hz <= 0.0 {
        return Err(crate::error::invalid("rate_hz", rate_hz, "must be positive"));
    }
    Ok(ImuCalibration { noise, rate_hz, body_from_imu })
}

fn pose(document: &Document, key: &str) -> Result<Isometry3<f64>, Error> {
    let m = document.numbers::<16>(key)?;
    let row = |r: usize| [m[4 * r], m[4 * r + 1], m[4 * r + 2], m[4 * r + 3]];
    let rows = [row(0), row(1), row(2)];
    let rotation = nalgebra::Matrix3::from_fn(|r, c| rows[r][c]);
    let error = (rotation * rotation.transpose() - nalgebra::Matrix3::identity()).norm();
    if error > ROTATION_TOLERANCE || rotation.determinant() < 0.0 || row(3) != [0.0, 0.0, 0.0, 1.0] {
        return Err(document.refuse(key, "is not a rigid motion: check its sixteen numbers"));
    }
    Ok(nearest_pose(&rows))
}

fn pose_text(pose: &Isometry3<f64>) -> String {
    let matrix = pose.to_homogeneous();
    let numbers: Vec<String> = matrix.transpose().iter().map(f64::to_string).collect();
    format!("T_BS:\n  cols: 4\n  rows: 4\n  data: [{}]\n", numbers.join(", "))
}
