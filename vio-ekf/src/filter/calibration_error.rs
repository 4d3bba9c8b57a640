//! How far the estimated calibration is from what was given.

use nalgebra::{DMatrix, DVector, Matrix3, UnitQuaternion, Vector3};

use crate::camera::Camera;
use crate::camera::model::CameraModel;
use crate::filter::calibration_prior::set_calibration;
use crate::filter::estimator::Estimator;
use crate::filter::report::Calibration;
use crate::filter::settings::Settings;
use crate::filter::state::error_state;
use crate::filter::state::vio_state::{SecondCamera, VioState};
use crate::inertial::covariance::Covariance;
use crate::lie::so3;

/// The estimate less what was given, with its covariances after and before the data. Rows as in
/// [`error_state`], from the camera's pose on, without the depth prior; a row that is not estimated has no variance.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct CalibrationError {
    pub(crate) error: DVector<f64>,
    pub(crate) posterior: DMatrix<f64>,
    pub(crate) prior: DMatrix<f64>,
}

impl CalibrationError {
    pub(crate) fn new(
        estimator: &Estimator,
        (first, second): (&dyn CameraModel, Option<&dyn CameraModel>),
        settings: &Settings,
    ) -> Self {
        let state = &estimator.state;
        let head = state.head();
        let mut error = DVector::zeros(head);
        let given = first.body_from_camera();
        let turned = |a: &UnitQuaternion<f64>, b: &UnitQuaternion<f64>| so3::log(&(a * b.inverse()));
        let mut set = |row: usize, values: &[f64]| error.as_mut_slice()[row..][..values.len()].copy_from_slice(values);
        set(error_state::CAMERA_POSITION, (state.camera_position - given.translation.vector).as_slice());
        set(error_state::CAMERA_ATTITUDE, turned(&state.camera_attitude, &given.rotation).as_slice());
        set(error_state::TIME_OFFSET, &[state.time_offset - settings.calibration.time_offset_s]);
        let matrix = state.accel_matrix() - Matrix3::identity();
        set(error_state::ACCEL_MATRIX, matrix.transpose().as_slice());
        if let (Some(lens), Some(given)) = (&state.lens, first.kalibr()) {
            set(error_state::INTRINSICS, &lens.intrinsics_less(&given.estimable()));
            set(error_state::ROW_TIME, &[state.row_time - settings.calibration.row_time_s]);
            set(error_state::GYRO_SCALE, state.gyro_scale.add_scalar(-1.0).as_slice());
        }
        let given = second.and_then(|second| SecondCamera::new(first, second));
        if let (Some(found), Some(given)) = (&state.second, given) {
            set(error_state::SECOND_INTRINSICS, &found.lens.intrinsics_less(&given.lens));
            set(
                error_state::SECOND_ATTITUDE,
                turned(&found.from_first.rotation, &given.from_first.rotation).as_slice(),
            );
            let moved = found.from_first.translation.vector - given.from_first.translation.vector;
            set(error_state::SECOND_POSITION, moved.as_slice());
        }
        let mut before = Covariance::new(head, head);
        set_calibration(&mut before, state, settings);
        let dense = |covariance: &Covariance| DMatrix::from_fn(head, head, |r, c| covariance.row(r)[c]);
        Self { error, posterior: dense(&estimator.covariance), prior: dense(&before) }
    }
}

/// The calibration of a state, with its deviations.
pub(crate) fn calibration_of(state: &VioState, covariance: &Covariance) -> Calibration {
    let deviation = |row: usize| covariance.variance(row).max(0.0).sqrt();
    Calibration {
        body_from_camera: state.body_from_camera(),
        time_offset_s: state.time_offset,
        camera: state.lens.map(|lens| Camera { body_from_camera: state.body_from_camera(), ..lens }),
        second_camera: state.second.map(|second| Camera {
            body_from_camera: state.body_from_camera() * second.from_first.inverse(),
            ..second.lens
        }),
        covariance: covariance.block(error_state::CAMERA_POSITION, error_state::CAMERA_POSITION),
        accel_matrix: state.accel_matrix(),
        accel_matrix_sigma: Matrix3::from_fn(|r, c| deviation(error_state::ACCEL_MATRIX + 3 * r + c)),
        row_time_s: state.row_time,
        row_time_sigma_s: state.lens.map_or(0.0, |_| deviation(error_state::ROW_TIME)),
        gyro_scale: state.gyro_scale,
        gyro_scale_sigma: match state.lens {
            Some(_) => Vector3::from_fn(|k, _| deviation(error_state::GYRO_SCALE + k)),
            None => Vector3::zeros(),
        },
    }
}

/// A state with what was given for all that is estimated of the calibration.
pub(crate) fn given_calibration(
    state: &VioState,
    (first, second): (&dyn CameraModel, Option<&dyn CameraModel>),
    settings: &Settings,
) -> VioState {
    let pose = first.body_from_camera();
    VioState {
        camera_position: pose.translation.vector,
        camera_attitude: pose.rotation,
        time_offset: settings.calibration.time_offset_s,
        accel_matrix: state.accel_matrix.map(|_| Matrix3::identity()),
        row_time: settings.calibration.row_time_s,
        gyro_scale: Vector3::repeat(1.0),
        lens: state.lens.and_then(|_| first.kalibr()).map(Camera::estimable),
        second: state.second.and_then(|_| SecondCamera::new(first, second?)),
        ..state.clone()
    }
}
