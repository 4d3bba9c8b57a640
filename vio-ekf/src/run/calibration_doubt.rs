//! What of a calibration is doubted, in values and in words.

use std::fmt;

use nalgebra::{UnitQuaternion, Vector3};

use crate::camera::{Camera, CameraModel};
use crate::filter::report::Calibration;
use crate::filter::vio::Vio;
use crate::format::calibration::CameraCalibration;
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
    /// All that was found, whether it is doubted or not; `None` where the images alone tell.
    pub found: Option<Calibration>,
    /// What the gyroscope's axes read of a rate, less one; zero where that is not doubted.
    pub(super) gyroscope: Vector3<f64>,
    /// What has to be added to the offset of the camera's clock, s.
    pub(super) clock_change_s: f64,
    /// In words, with what was found.
    pub(super) words: String,
}

impl CalibrationDoubt {
    /// What each axis of the gyroscope reads of a rate: 1 where that is not doubted.
    pub fn gyroscope_scale(&self) -> Vector3<f64> {
        self.gyroscope.add_scalar(1.0)
    }

    /// Divides the readings of the gyroscope by [its scale](Self::gyroscope_scale).
    pub fn correct_samples(&self, samples: &mut [Imu]) {
        for sample in samples {
            sample.gyro.component_div_assign(&self.gyroscope_scale());
        }
    }

    /// Puts what was found in place of what is doubted of the cameras, and leaves the rest. Of one camera or two.
    pub fn correct(&self, cameras: &mut [CameraCalibration]) {
        let Some(found) = &self.found else { return };
        let doubted = |part: Part| self.parts.contains(&part);
        let Some(first) = cameras.first() else { return };
        let before = first.camera.body_from_camera;
        let mut after = before;
        if doubted(Part::CameraAttitude) {
            after.rotation = found.body_from_camera.rotation;
        }
        if doubted(Part::CameraPosition) {
            after.translation = found.body_from_camera.translation;
        }
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
pub(super) fn describe(
    part: CalibrationPart,
    (found, gyroscope): (&Calibration, &Vector3<f64>),
    given: &Vio,
) -> String {
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
        Part::Accelerometer => "scale or axes of the accelerometer".into(),
        Part::Gyroscope => {
            let [x, y, z] = [0, 1, 2].map(|axis| format!("{:+.1}", 100.0 * gyroscope[axis]));
            format!("scale of the gyroscope, which reads {x}, {y}, {z} % on its axes")
        }
        Part::FocalLength => focal("focal lengths", given, lens),
        Part::PrincipalPoint => centre("principal point", given, lens),
        Part::Distortion => distortion("distortion", given, lens),
        Part::SecondFocalLength => focal("focal lengths of the second camera", others, other),
        Part::SecondPrincipalPoint => centre("principal point of the second camera", others, other),
        Part::SecondDistortion => distortion("distortion of the second camera", others, other),
        Part::StereoPose => "pose of the second camera against the first".into(),
    }
}
