//! What is known of the calibration before the images tell.

use nalgebra::SVector;

use crate::camera::Camera;
use crate::camera::model::CameraModel;
use crate::filter::settings::{CalibrationSettings, Settings};
use crate::filter::state::error_state;
use crate::filter::state::vio_state::{SecondCamera, VioState};
use crate::inertial::covariance::Covariance;
use crate::inertial::imu_noise_estimator::ImuSettings;

/// The accelerometer's matrix, row by row.
pub(crate) type Entries = SVector<f64, { error_state::MATRIX_SIZE }>;

/// Deviation of one axis' focal length from the other's, in units of that of both.
const ASPECT: f64 = 0.1;
/// Deviation of the second term of the distortion, in units of that of the first.
const SECOND_TERM: f64 = 1.0 / 3.0;

impl SecondCamera {
    /// `None` where a lens is not one of Kalibr's.
    pub(crate) fn new(first: &dyn CameraModel, second: &dyn CameraModel) -> Option<Self> {
        let from_first = second.body_from_camera().inverse() * first.body_from_camera();
        Some(Self { lens: second.kalibr()?.estimable(), from_first })
    }
}

/// Sets the covariance of all that is estimated of the calibration.
pub(crate) fn set_calibration(covariance: &mut Covariance, state: &VioState, settings: &Settings) {
    let Settings { calibration, imu, .. } = settings;
    covariance.set_diagonal3(error_state::CAMERA_POSITION, [calibration.camera_position_sigma_m; 3]);
    covariance.set_diagonal3(error_state::CAMERA_ATTITUDE, [calibration.camera_attitude_sigma; 3]);
    covariance.reset_row(error_state::TIME_OFFSET, calibration.time_offset_sigma_s.unwrap_or(0.0).powi(2));
    if state.accel_matrix.is_some() {
        for (entry, sigma) in prior_sigma(imu).iter().enumerate() {
            covariance.reset_row(error_state::ACCEL_MATRIX + entry, sigma * sigma);
        }
    }
    if state.lens.is_some() {
        // Rolling shutters are known of one camera alone.
        let row_time_sigma = if state.second.is_some() { 0.0 } else { calibration.row_time_sigma_s };
        covariance.reset_row(error_state::ROW_TIME, row_time_sigma.powi(2));
        covariance.set_diagonal3(error_state::GYRO_SCALE, [imu.gyro_scale_sigma; 3]);
    }
    set_lenses(covariance, state, calibration);
}

fn set_lenses(covariance: &mut Covariance, state: &VioState, settings: &CalibrationSettings) {
    if let Some(lens) = &state.lens {
        set_lens(covariance, error_state::INTRINSICS, lens, settings);
    }
    if let Some(second) = &state.second {
        set_lens(covariance, error_state::SECOND_INTRINSICS, &second.lens, settings);
        covariance.set_diagonal3(error_state::SECOND_ATTITUDE, [settings.stereo_attitude_sigma; 3]);
        covariance.set_diagonal3(error_state::SECOND_POSITION, [settings.stereo_position_sigma_m; 3]);
    }
}

fn set_lens(covariance: &mut Covariance, row: usize, lens: &Camera, settings: &CalibrationSettings) {
    let common = settings.focal_sigma.powi(2);
    let aspect = common * ASPECT * ASPECT;
    covariance.reset_row(row, lens.fx * lens.fx * (common + aspect));
    covariance.reset_row(row + 1, lens.fy * lens.fy * (common + aspect));
    covariance.set_covariance(row, row + 1, lens.fx * lens.fy * common);
    for k in 2..4 {
        covariance.reset_row(row + k, settings.principal_point_sigma_px.powi(2));
    }
    covariance.reset_row(row + 4, settings.distortion_sigma.powi(2));
    covariance.reset_row(row + 5, (settings.distortion_sigma * SECOND_TERM).powi(2));
}

/// Deviations of the entries; one that is known exactly hardly counts.
pub(crate) fn prior_sigma(settings: &ImuSettings) -> Entries {
    Entries::from_fn(|k, _| settings.accel_matrix_sigma(k).max(1e-9))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Both focal lengths err by 2 % together and by 0.2 % each: variances of f^2 (0.02^2 + 0.002^2), covariance of fx fy 0.02^2.
    #[test]
    fn focal_lengths_are_uncertain_together() {
        let lens = Camera { fx: 400.0, fy: 500.0, ..Camera::euroc() };
        let settings = CalibrationSettings {
            focal_sigma: 0.02,
            principal_point_sigma_px: 3.0,
            distortion_sigma: 0.06,
            ..CalibrationSettings::default()
        };
        let mut covariance = Covariance::new(10, 10);
        set_lens(&mut covariance, 2, &lens, &settings);
        let found = covariance.block::<6, 6>(2, 2);
        let expected = |row: usize, column: usize| match (row, column) {
            (0, 0) => 64.64,
            (0, 1) => 80.0,
            (1, 1) => 101.0,
            (2, 2) | (3, 3) => 9.0,
            (4, 4) => 3.6e-3,
            (5, 5) => 4e-4,
            _ => 0.0,
        };
        for (row, column) in (0..6).flat_map(|row| (row..6).map(move |column| (row, column))) {
            let (found, expected) = (found[(row, column)], expected(row, column));
            assert!((found - expected).abs() < 1e-12 * (1.0 + expected), "{row} {column}: {found} {expected}");
        }
    }
}
