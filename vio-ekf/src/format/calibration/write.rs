//! Writes the `sensor.yaml` of EuRoC/ASL folders.

use nalgebra::Isometry3;

use super::types::{CameraCalibration, ImuCalibration};
use crate::camera::Distortion;

/// The `sensor.yaml` of an EuRoC/ASL camera. `Distortion::None` becomes a polynomial of zeros, which it equals.
pub fn write_asl_camera(calibration: &CameraCalibration) -> String {
    let camera = &calibration.camera;
    let (projection, own, model, k): (&str, &[f64], &str, &[f64]) = match &camera.distortion {
        Distortion::None => ("pinhole", &[], "radial-tangential", &[0.0; 4]),
        Distortion::RadTan(k) => ("pinhole", &[], "radial-tangential", k),
        Distortion::Equidistant(k) => ("pinhole", &[], "equidistant", k),
        Distortion::Omni { xi, radtan } => ("omni", std::slice::from_ref(xi), "radial-tangential", radtan),
        Distortion::DoubleSphere(k) => ("ds", k, "none", &[]),
        Distortion::Eucm(k) => ("eucm", k, "none", &[]),
    };
    let rate = calibration.rate_hz.map_or(String::new(), |rate| format!("rate_hz: {rate}\n"));
    let row_time = match calibration.row_time_s {
        0.0 => String::new(),
        seconds => format!("line_delay: {seconds}\n"),
    };
    let list = |numbers: &[f64]| numbers.iter().map(f64::to_string).collect::<Vec<_>>().join(", ");
    let intrinsics = list(&[own, &[camera.fx, camera.fy, camera.cx, camera.cy]].concat());
    format!(
        "%YAML:1.0\nsensor_type: camera\n{}{rate}resolution: [{}, {}]\ncamera_model: {projection}\n\
         intrinsics: [{intrinsics}]\ndistortion_model: {model}\ndistortion_coefficients: [{}]\n{row_time}",
        pose_text(&camera.body_from_camera),
        camera.width,
        camera.height,
        list(k)
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

fn pose_text(pose: &Isometry3<f64>) -> String {
    let matrix = pose.to_homogeneous();
    let numbers: Vec<String> = matrix.transpose().iter().map(f64::to_string).collect();
    format!("T_BS:\n  cols: 4\n  rows: 4\n  data: [{}]\n", numbers.join(", "))
}
