//! What of a calibration is doubted, in values and in words.

use std::fmt;

use nalgebra::{Isometry3, UnitQuaternion, Vector3};

use crate::camera::{Camera, CameraModel};
use crate::filter::report::Calibration;
use crate::filter::settings::Settings;
use crate::filter::vio::Vio;
use crate::format::calibration::CameraCalibration;
use crate::inertial::imu_noise_estimator::AccelMatrixEstimation;
use crate::samples::Imu;

/// A part of a calibration.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum CalibrationPart {
    /// Which images are of which of two cameras.
    CameraOrder,
    /// Angles of the camera on the body.
    CameraAttitude,
    /// Place of the camera on the body.
    CameraPosition,
    /// Offset of the camera's clock.
    Clock,
    /// Scale and axes of the accelerometer.
    Accelerometer,
    /// Scales of the gyroscope's axes.
    Gyroscope,
    /// Focal length.
    FocalLength,
    /// Principal point.
    PrincipalPoint,
    /// First terms of the distortion.
    Distortion,
    /// Time from a row of the image to the next.
    RollingShutter,
    /// Focal length of the second camera.
    SecondFocalLength,
    /// Its principal point.
    SecondPrincipalPoint,
    /// Its distortion.
    SecondDistortion,
    /// Pose of one camera against the other.
    StereoPose,
}

use CalibrationPart as Part;

/// What of the calibration the images contradict.
#[derive(Debug, Clone, PartialEq)]
pub struct CalibrationDoubt {
    /// The parts, the most certain first; not empty.
    pub parts: Vec<CalibrationPart>,
    /// What was found of these parts with the others as they were given; `None` where the images alone tell.
    pub found: Option<Calibration>,
    /// Whether the length of gravity has raised it, not images.
    pub(super) by_gravity: bool,
    /// Pose of the first camera on the body of the filter, as it was given.
    pub(super) given_pose: Isometry3<f64>,
    /// What has to be added to the offset of the camera's clock, s.
    pub(super) clock_change_s: f64,
    /// The same of the time of a row, s.
    pub(super) row_time_change_s: f64,
    /// In words, with what was found.
    pub(super) words: String,
}

impl CalibrationDoubt {
    /// Puts right what is doubted of the readings: those of the gyroscope times [its scale](Calibration::gyro_scale), those of the
    /// accelerometer by [its matrix](Calibration::accel_matrix).
    pub fn correct_samples(&self, samples: &mut [Imu]) {
        let Some(found) = &self.found else { return };
        let doubted = [Part::Gyroscope, Part::Accelerometer].map(|part| self.parts.contains(&part));
        for sample in samples.iter_mut().filter(|_| doubted.contains(&true)) {
            if doubted[0] {
                sample.gyro.component_mul_assign(&found.gyro_scale);
            }
            if doubted[1] {
                sample.accel = found.accel_matrix * sample.accel;
            }
        }
    }

    /// Settings of a filter that is given what was found, and goes on to estimate what was doubted, a tenth of
    /// [`with_rough_calibration`](Settings::with_rough_calibration) from it. What was not doubted stays as certain as it was.
    #[must_use]
    pub fn freed(&self, settings: &Settings) -> Settings {
        let (mut freed, near) = (*settings, settings.calibration.nearly());
        let rough = Settings::default().with_rough_calibration().imu;
        let calibration = &mut freed.calibration;
        for part in &self.parts {
            match part {
                Part::CameraOrder => {}
                Part::CameraAttitude => calibration.camera_attitude_sigma = near.camera_attitude_sigma,
                Part::CameraPosition => calibration.camera_position_sigma_m = near.camera_position_sigma_m,
                Part::Clock => calibration.time_offset_sigma_s = near.time_offset_sigma_s,
                // A mean force is gravity to a percent or two, which is what a filter allows for by itself.
                Part::Accelerometer if self.by_gravity => {}
                Part::Accelerometer => {
                    freed.imu.accel_matrix = AccelMatrixEstimation::Always;
                    freed.imu.accel_scale_sigma = 0.1 * rough.accel_scale_sigma;
                    freed.imu.accel_misalignment_sigma = 0.1 * rough.accel_misalignment_sigma;
                }
                Part::Gyroscope => freed.imu.gyro_scale_sigma = 0.1 * rough.gyro_scale_sigma,
                Part::FocalLength | Part::SecondFocalLength => calibration.focal_sigma = near.focal_sigma,
                Part::PrincipalPoint | Part::SecondPrincipalPoint => {
                    calibration.principal_point_sigma_px = near.principal_point_sigma_px;
                }
                Part::Distortion | Part::SecondDistortion => calibration.distortion_sigma = near.distortion_sigma,
                Part::RollingShutter => calibration.row_time_sigma_s = near.row_time_sigma_s,
                Part::StereoPose => {
                    calibration.stereo_attitude_sigma = near.stereo_attitude_sigma;
                    calibration.stereo_position_sigma_m = near.stereo_position_sigma_m;
                }
            }
        }
        freed
    }

    /// Puts what was found in place of what is doubted of the cameras, and leaves the rest. Of one camera or two.
    pub fn correct(&self, cameras: &mut [CameraCalibration]) {
        let Some(found) = &self.found else { return };
        let doubted = |part: Part| self.parts.contains(&part);
        let Some(first) = cameras.first() else { return };
        let before = first.camera.body_from_camera;
        let mut on_sensor = self.given_pose;
        if doubted(Part::CameraAttitude) {
            on_sensor.rotation = found.body_from_camera.rotation;
        }
        if doubted(Part::CameraPosition) {
            on_sensor.translation = found.body_from_camera.translation;
        }
        // The filter's body is the inertial sensor, that of the calibration may be another.
        let after = if on_sensor == self.given_pose { before } else { before * self.given_pose.inverse() * on_sensor };
        let parts = [
            (found.camera, [Part::FocalLength, Part::PrincipalPoint, Part::Distortion]),
            (found.second_camera, [Part::SecondFocalLength, Part::SecondPrincipalPoint, Part::SecondDistortion]),
        ];
        for (index, (calibration, (lens, [focal, centre, distortion]))) in cameras.iter_mut().zip(parts).enumerate() {
            let camera = &mut calibration.camera;
            // A rig is moved as a whole, unless how its cameras stand to each other is doubted too.
            let first_from_this = before.inverse() * camera.body_from_camera;
            camera.body_from_camera = if index == 0 { after } else { after * first_from_this };
            if doubted(Part::Clock) {
                calibration.time_offset_s += self.clock_change_s;
            }
            if index == 0 && doubted(Part::RollingShutter) {
                calibration.row_time_s += self.row_time_change_s;
            }
            let Some(lens) = lens else { continue };
            if index == 1 && doubted(Part::StereoPose) {
                camera.body_from_camera = after * found.body_from_camera.inverse() * lens.body_from_camera;
            }
            if doubted(focal) {
                (camera.fx, camera.fy) = (lens.fx, lens.fy);
            }
            if doubted(centre) {
                (camera.cx, camera.cy) = (lens.cx, lens.cy);
            }
            if doubted(distortion) {
                camera.distortion = lens.distortion;
            }
        }
    }
}

impl fmt::Display for CalibrationDoubt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.words)
    }
}

/// A part of what a filter has found beside what another one was given, in words.
pub(super) fn describe(part: CalibrationPart, found: &Calibration, given: &Vio) -> String {
    let settings = given.settings();
    let camera = given.camera();
    let second = given.second_camera().ok();
    let focal = |name: &str, given: Option<Camera>, found: Option<Camera>| match (given, found) {
        (Some(given), Some(found)) => {
            format!("{name} {:.1}, {:.1} px, found {:.1}, {:.1}", given.fx, given.fy, found.fx, found.fy)
        }
        _ => name.to_owned(),
    };
    let centre = |name: &str, given: Option<Camera>, found: Option<Camera>| match (given, found) {
        (Some(given), Some(found)) => {
            format!("{name} ({:.1}, {:.1}), found ({:.1}, {:.1})", given.cx, given.cy, found.cx, found.cy)
        }
        _ => name.to_owned(),
    };
    let distortion = |name: &str, given: Option<Camera>, found: Option<Camera>| match (given, found) {
        (Some(given), Some(found)) => format!("{name} {:?}, found {:.3?}", given.distortion, found.distortion),
        _ => name.to_owned(),
    };
    let (given, others) = (camera.kalibr(), second.and_then(CameraModel::kalibr));
    let (lens, other) = (found.camera, found.second_camera);
    match part {
        Part::CameraOrder => "order of the cameras".into(),
        Part::CameraAttitude => {
            let turned: UnitQuaternion<f64> =
                found.body_from_camera.rotation * camera.body_from_camera().rotation.inverse();
            format!("attitude of the camera on the body, found {:.1} degrees off", turned.angle().to_degrees())
        }
        Part::CameraPosition => {
            let moved = found.body_from_camera.translation.vector - camera.body_from_camera().translation.vector;
            format!("place of the camera on the body, found {:.0} mm off", 1e3 * moved.norm())
        }
        Part::Clock => {
            let given = settings.calibration.time_offset_s;
            format!("clock of the camera, offset {:.1} ms, found {:.1}", 1e3 * given, 1e3 * found.time_offset_s)
        }
        Part::Accelerometer => {
            format!(
                "scale or axes of the accelerometer, which reads {} % on its axes",
                percent(&found.accel_matrix.diagonal())
            )
        }
        Part::Gyroscope => {
            format!("scale of the gyroscope, which reads {} % on its axes", percent(&found.gyro_scale))
        }
        Part::FocalLength => focal("focal lengths", given, lens),
        Part::PrincipalPoint => centre("principal point", given, lens),
        Part::Distortion => distortion("distortion", given, lens),
        Part::RollingShutter => {
            let [given, found] = [settings.calibration.row_time_s, found.row_time_s].map(|row| 1e6 * row);
            let whole = 1e-3 * found * camera.image_size().1 as f64;
            format!(
                "rolling shutter, {given:.1} us from row to row (line_delay), found {found:.1}: {whole:.1} ms an image"
            )
        }
        Part::SecondFocalLength => focal("focal lengths of the second camera", others, other),
        Part::SecondPrincipalPoint => centre("principal point of the second camera", others, other),
        Part::SecondDistortion => distortion("distortion of the second camera", others, other),
        Part::StereoPose => "pose of the second camera against the first".into(),
    }
}

/// By how much a sensor reads too much on its axes, from what its readings have to be multiplied by.
fn percent(correction: &Vector3<f64>) -> String {
    let [x, y, z] = [0, 1, 2].map(|axis| format!("{:+.1}", 100.0 * (correction[axis].recip() - 1.0)));
    format!("{x}, {y}, {z}")
}

#[cfg(test)]
pub(super) mod tests {
    use nalgebra::{Matrix3, SMatrix};

    use super::*;
    use crate::filter::settings::CalibrationSettings;
    use crate::lie::so3;
    use crate::stamp::Stamp;

    pub(in crate::run) fn found(camera: Camera) -> Calibration {
        Calibration {
            body_from_camera: camera.body_from_camera,
            time_offset_s: 0.0,
            camera: Some(camera),
            second_camera: None,
            covariance: SMatrix::zeros(),
            accel_matrix: Matrix3::identity() * 1.25,
            accel_matrix_sigma: Matrix3::zeros(),
            row_time_s: 6e-5,
            row_time_sigma_s: 0.0,
            gyro_scale: Vector3::new(1.0, 0.5, 2.0),
            gyro_scale_sigma: Vector3::zeros(),
        }
    }

    pub(in crate::run) fn doubt(given: &Camera, found: &Calibration, part: Part) -> CalibrationDoubt {
        let given_pose = given.body_from_camera;
        CalibrationDoubt {
            parts: vec![part],
            found: Some(*found),
            by_gravity: false,
            given_pose,
            clock_change_s: 0.0,
            row_time_change_s: 0.0,
            words: String::new(),
        }
    }

    /// The body of the calibration is not the inertial sensor, in whose axes the filter finds the camera.
    #[test]
    fn a_camera_is_turned_where_it_stands_on_the_body_of_its_calibration() {
        let given = Camera::euroc();
        let body_from_sensor = Isometry3::new(Vector3::new(0.3, -0.2, 0.1), Vector3::new(0.4, -1.0, 0.7));
        let turned = so3::exp(&Vector3::new(0.02, 0.01, -0.03)) * given.body_from_camera.rotation;
        let right = Isometry3::from_parts(given.body_from_camera.translation, turned);
        let camera = Camera { body_from_camera: body_from_sensor * given.body_from_camera, ..given };
        let mut cameras = [CameraCalibration { camera, rate_hz: None, time_offset_s: 0.0, row_time_s: 0.0 }];
        let found = found(Camera { body_from_camera: right, ..given });
        doubt(&given, &found, Part::CameraAttitude).correct(&mut cameras);
        let error = cameras[0].camera.body_from_camera.inverse() * body_from_sensor * right;
        assert!(error.translation.vector.norm() < 1e-12 && error.rotation.angle() < 1e-12, "{error}");
    }

    #[test]
    fn readings_are_put_right_only_where_they_are_doubted() {
        let sample = Imu { stamp: Stamp::from_nanos(0), gyro: Vector3::new(1.0, 2.0, 3.0), accel: Vector3::z() * 8.0 };
        let corrected = |part: Part| {
            let mut samples = [sample];
            doubt(&Camera::euroc(), &found(Camera::euroc()), part).correct_samples(&mut samples);
            (samples[0].gyro, samples[0].accel)
        };
        assert_eq!(corrected(Part::Gyroscope), (Vector3::new(1.0, 1.0, 6.0), sample.accel));
        assert_eq!(corrected(Part::Accelerometer), (sample.gyro, Vector3::z() * 10.0));
        assert_eq!(corrected(Part::Clock), (sample.gyro, sample.accel));
    }

    #[test]
    fn only_what_is_doubted_goes_on_to_be_estimated() {
        let settings = Settings::default();
        let freed = |part: Part| doubt(&Camera::euroc(), &found(Camera::euroc()), part).freed(&settings);
        assert_eq!(freed(Part::CameraOrder), settings);
        let expected = CalibrationSettings { focal_sigma: 0.003, ..settings.calibration };
        assert!((freed(Part::FocalLength).calibration.focal_sigma - 0.003).abs() < 1e-12);
        let focal = freed(Part::FocalLength).calibration;
        assert_eq!(CalibrationSettings { focal_sigma: 0.003, ..focal }, expected);
        assert_eq!(freed(Part::Gyroscope).calibration, settings.calibration);
        assert!(freed(Part::Gyroscope).imu.gyro_scale_sigma > 0.0);
        // What images have found of the accelerometer is near; what gravity says is not that exact.
        assert_eq!(freed(Part::Accelerometer).imu.accel_matrix, AccelMatrixEstimation::Always);
        let by_images = doubt(&Camera::euroc(), &found(Camera::euroc()), Part::Accelerometer);
        assert_eq!(CalibrationDoubt { by_gravity: true, ..by_images }.freed(&settings), settings);
    }
}
