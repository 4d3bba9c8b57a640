//! Calibrations: the `sensor.yaml` of EuRoC/ASL folders, and the camera and inertial chains that Kalibr writes. Reading
//! needs the feature `yaml`.
//!
//! The files say the same in different words: EuRoC's `T_BS` and Kalibr's `T_imu_cam` are `body_from_camera`, Kalibr's
//! `T_cam_imu` is its inverse; the body is the inertial sensor.

#[cfg(feature = "yaml")]
mod read;
#[cfg(feature = "yaml")]
mod schema;
#[cfg(feature = "yaml")]
mod section;
mod types;
mod write;

#[cfg(feature = "yaml")]
pub use read::{read_asl_camera, read_asl_imu, read_kalibr_cameras, read_kalibr_imu};
pub use types::{CameraCalibration, ImuCalibration};
pub use write::{write_asl_camera, write_asl_imu};
