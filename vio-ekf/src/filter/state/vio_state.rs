//! The nominal state.

use nalgebra::{Isometry3, Matrix3, Translation3, UnitQuaternion, Vector3};

use super::error_state;
use super::inverse_distance::InverseDistance;
use super::landmark::Landmark;
use crate::camera::Camera;
use crate::camera::intrinsics::INTRINSICS;
use crate::inertial::core_state::{CoreState, ImuCorrection, block, rotated};

/// The state of the odometry: core, calibration of the camera, landmarks in the camera's axes (Bloesch et al. 2017).
#[derive(Debug, Clone, PartialEq)]
pub struct VioState {
    /// Pose, velocity and biases of the body.
    pub(crate) core: CoreState,
    /// Position of the camera on the body.
    pub(crate) camera_position: Vector3<f64>,
    /// Attitude of the camera, `body_from_camera`.
    pub(crate) camera_attitude: UnitQuaternion<f64>,
    /// Seconds to add to a camera's stamp to get the inertial sensor's time.
    pub(crate) time_offset: f64,
    /// The shared depth prior, 1/m: the inverse distance of a new landmark is this plus an error of its own, so that all landmarks
    /// together know no more of the scale than the prior does.
    pub(crate) depth_prior: InverseDistance,
    /// Specific force by the accelerometer's reading; `None`, the identity, where it is not estimated.
    pub(crate) accel_matrix: Option<Matrix3<f64>>,
    /// Time from the exposure of a row of the first camera until that of the row below; known where `lens` is not there.
    pub(crate) row_time: f64,
    /// Rate by what the gyroscope reads, axis by axis; used where `lens` is there, and one everywhere else.
    pub(crate) gyro_scale: Vector3<f64>,
    /// The first camera, where its intrinsics are estimated.
    pub(crate) lens: Option<Camera>,
    /// The second one, likewise.
    pub(crate) second: Option<SecondCamera>,
    pub(crate) landmarks: Vec<Landmark>,
}

/// A second camera whose calibration is estimated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SecondCamera {
    /// Its lens; the pose is not used.
    pub(crate) lens: Camera,
    /// Pose of the first camera in its axes.
    pub(crate) from_first: Isometry3<f64>,
}

impl SecondCamera {
    fn correct(&mut self, delta: &[f64]) {
        self.lens = self.lens.with_intrinsics_changed(&intrinsics(delta, error_state::SECOND_INTRINSICS));
        self.from_first.rotation = rotated(&block(delta, error_state::SECOND_ATTITUDE), &self.from_first.rotation);
        self.from_first.translation.vector += block(delta, error_state::SECOND_POSITION);
    }
}

fn intrinsics(delta: &[f64], row: usize) -> [f64; INTRINSICS] {
    std::array::from_fn(|k| delta[row + k])
}

impl VioState {
    /// Rows before the first landmark.
    pub(crate) fn head(&self) -> usize {
        match (&self.lens, &self.second) {
            (None, _) => error_state::FIXED,
            (Some(_), None) => error_state::SECOND_INTRINSICS,
            (Some(_), Some(_)) => error_state::MAX_HEAD,
        }
    }

    /// First row of a landmark.
    pub(crate) fn landmark_row(&self, slot: usize) -> usize {
        error_state::landmark(self.head(), slot)
    }

    /// Pose, velocity and biases of the body.
    pub fn core(&self) -> &CoreState {
        &self.core
    }

    /// Pose of the camera on the body.
    pub fn body_from_camera(&self) -> Isometry3<f64> {
        Isometry3::from_parts(Translation3::from(self.camera_position), self.camera_attitude)
    }

    /// Seconds to add to the camera's stamps to get the inertial sensor's time.
    pub fn time_offset_s(&self) -> f64 {
        self.time_offset
    }

    /// The matrix `A` of the accelerometer: with a reading `f̃` the specific force is `A f̃ − b_a`. The identity where it is not
    /// estimated ([`ImuSettings::accel_scale_sigma`](crate::inertial::ImuSettings::accel_scale_sigma)).
    pub fn accel_matrix(&self) -> Matrix3<f64> {
        self.accel_matrix.unwrap_or_else(Matrix3::identity)
    }

    /// What has to be taken out of inertial readings.
    pub(crate) fn imu_correction(&self) -> ImuCorrection {
        let gyro_scale = self.lens.map(|_| self.gyro_scale);
        ImuCorrection { accel_matrix: self.accel_matrix, gyro_scale, ..self.core.imu_correction() }
    }

    /// `x ← x ⊞ δ`.
    #[cfg(test)]
    pub(crate) fn correct(&mut self, delta: &[f64]) {
        self.correct_head(delta);
        let landmark_errors = delta[self.head()..].chunks_exact(error_state::LANDMARK_SIZE);
        for (landmark, d) in self.landmarks.iter_mut().zip(landmark_errors) {
            landmark.bearing = landmark.bearing.boxplus(&nalgebra::Vector2::new(d[0], d[1]));
            landmark.inverse_distance.correct(d[2]);
        }
    }

    /// The same for all but the landmarks.
    pub(crate) fn correct_head(&mut self, delta: &[f64]) {
        self.core = self.core.corrected(delta);
        self.camera_position += block(delta, error_state::CAMERA_POSITION);
        self.camera_attitude = rotated(&block(delta, error_state::CAMERA_ATTITUDE), &self.camera_attitude);
        self.time_offset += delta[error_state::TIME_OFFSET];
        self.depth_prior.correct(delta[error_state::DEPTH_PRIOR]);
        if let Some(matrix) = &mut self.accel_matrix {
            let rows = &delta[error_state::ACCEL_MATRIX..][..error_state::MATRIX_SIZE];
            *matrix += Matrix3::from_row_slice(rows);
        }
        if let Some(lens) = &mut self.lens {
            *lens = lens.with_intrinsics_changed(&intrinsics(delta, error_state::INTRINSICS));
            self.row_time += delta[error_state::ROW_TIME];
            self.gyro_scale += block(delta, error_state::GYRO_SCALE);
        }
        if let Some(second) = &mut self.second {
            second.correct(delta);
        }
    }
}

#[cfg(test)]
impl VioState {
    /// At rest at the origin, without landmarks: for measurements that do not look at it.
    pub(crate) fn empty() -> Self {
        let (zero, identity) = (Vector3::zeros(), UnitQuaternion::identity());
        Self {
            core: CoreState { position: zero, velocity: zero, attitude: identity, gyro_bias: zero, accel_bias: zero },
            camera_position: zero,
            camera_attitude: identity,
            time_offset: 0.0,
            depth_prior: InverseDistance::new(1.0),
            accel_matrix: None,
            row_time: 0.0,
            gyro_scale: Vector3::repeat(1.0),
            lens: None,
            second: None,
            landmarks: Vec::new(),
        }
    }
}
