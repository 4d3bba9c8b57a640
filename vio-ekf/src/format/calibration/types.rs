//! What a calibration file says of a camera and of an inertial sensor.

use nalgebra::Isometry3;

use crate::camera::Camera;
use crate::samples::ImuNoise;

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
    /// Time from the exposure of a row until that of the row below (`line_delay`), s; 0, a global shutter, where the file does not say.
    pub row_time_s: f64,
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
