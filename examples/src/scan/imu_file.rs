//! How the camera turns, as a gyroscope beside the recording has it.

use std::path::Path;

use nalgebra::{UnitQuaternion, Vector3};

use super::error::SequenceError;

/// Reads `imu0/data.csv` of the EuRoC layout (nanoseconds, angular rate, specific force; the clock of the images): seconds, and the rate along the axes of the camera, rad/s. `body_from_camera` is how
/// the camera is turned against the unit.
///
/// # Errors
/// [`SequenceError`]; a file that covers none of the stamps from `first` to `last` is one.
pub(super) fn read_angular_rates(
    path: &Path,
    body_from_camera: &UnitQuaternion<f64>,
    [first, last]: [f64; 2],
) -> Result<Vec<(f64, Vector3<f64>)>, SequenceError> {
    let text = std::fs::read_to_string(path).map_err(|e| SequenceError::unreadable(path, &e))?;
    let samples =
        vio_ekf::format::asl::read_imu(&text).map_err(|e| SequenceError::malformed(path, 0, e.to_string()))?;
    let camera_from_body = body_from_camera.inverse();
    let rates: Vec<_> = samples.iter().map(|s| (s.stamp.as_secs(), camera_from_body * s.gyro)).collect();
    let [begin, end] = [rates[0].0, rates[rates.len() - 1].0];
    if begin > last || end < first {
        let why =
            format!("its stamps ({begin:.3} to {end:.3} s) are not those of the images ({first:.3} to {last:.3} s)");
        return Err(SequenceError::malformed(path, 0, why));
    }
    Ok(rates)
}
