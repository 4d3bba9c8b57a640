//! The axes of the inertial samples beside the images, before the filter runs.

use vio_ekf::{ImuDoubt, PatchSettings, PointObservation, PointTracker, Stamp, check_imu_axes};

use super::camera_frames::{CameraFrame, camera_frames};
use super::diagnosis::busiest_window;
use super::error::VioError;
use super::recording::Recording;

/// Length of the part of the recording that is looked at, s: the one with the most rotation.
const WINDOW_S: f64 = 12.0;

/// What the images say about the axes of both inertial sensors; nothing where they say nothing against them.
///
/// # Errors
/// [`VioError::Library`] if the camera's calibration cannot be.
pub fn axes_doubts(recording: &Recording, gravity: f64) -> Result<Vec<ImuDoubt>, VioError> {
    let Some((from, until)) = busiest_window(&recording.samples, WINDOW_S) else { return Ok(Vec::new()) };
    let camera = recording.camera.camera;
    let mut tracker = PointTracker::new(camera, &PatchSettings::default())?;
    let mut images: Vec<(Stamp, Vec<PointObservation>)> = Vec::new();
    let frames = camera_frames(recording).skip_while(|frame| frame.stamp < from);
    for CameraFrame { stamp, picture, .. } in frames.take_while(|frame| frame.stamp <= until) {
        // What cannot be read is counted by the run.
        let Ok(picture) = picture else { continue };
        if let Ok(points) = tracker.image(&picture.view()) {
            images.push((stamp, points));
        }
    }
    let about = |sample: &&vio_ekf::Imu| (from.plus_secs(-1.0)..=until.plus_secs(1.0)).contains(&sample.stamp);
    let samples: Vec<_> = recording.samples.iter().filter(about).copied().collect();
    if samples.len() < 2 {
        return Ok(Vec::new());
    }
    let found = check_imu_axes(&samples, &images, &camera, (gravity, recording.camera.time_offset_s))?;
    let doubt = |sensor, reading: Option<vio_ekf::AxesReading>| Some(ImuDoubt::Images { sensor, reading: reading? });
    Ok([doubt("gyroscope", found.gyro), doubt("accelerometer", found.accel)].into_iter().flatten().collect())
}
