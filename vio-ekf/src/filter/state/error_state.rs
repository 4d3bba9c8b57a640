//! First row of each block of the odometry's error state.
//!
//! ```text
//! rows   0  3  6  9  12 | 15       18       21      22           23           | 32          38        39           42            | then 3 each
//!        p  v  R  b_g b_a | camera's pose  offset  depth prior  accel. matrix | intrinsics  row time  gyro. scale  second camera | landmark: bearing (2), inverse distance (1)
//! ```

use crate::camera::intrinsics;
pub use crate::inertial::error_state::{ACCEL_BIAS, ATTITUDE, CORE, GYRO_BIAS, POSITION, VELOCITY};

/// Position of the camera on the body, m.
pub const CAMERA_POSITION: usize = 15;
/// Attitude of the camera on the body, rad, error on the body's side.
pub const CAMERA_ATTITUDE: usize = 18;
/// Time offset of the camera, s.
pub const TIME_OFFSET: usize = 21;
/// The shared depth prior: inverse distance expected of new landmarks, 1/m.
pub const DEPTH_PRIOR: usize = 22;
/// Matrix of the accelerometer, row by row: relative errors of its scale on the diagonal, angles beside it.
pub const ACCEL_MATRIX: usize = 23;
/// Entries of a 3x3 matrix.
pub(crate) const MATRIX_SIZE: usize = 9;
/// Rows that are always there.
pub(crate) const FIXED: usize = 32;
/// Intrinsics of the first camera, where they are estimated: focal lengths, principal point, first two terms of the distortion.
pub const INTRINSICS: usize = FIXED;
/// Time of a row of the first camera's shutter, where intrinsics are estimated, s.
pub const ROW_TIME: usize = INTRINSICS + intrinsics::INTRINSICS;
/// Scales of the gyroscope's axes, where intrinsics are estimated: relative errors.
pub const GYRO_SCALE: usize = ROW_TIME + 1;
/// Intrinsics of a second camera, then its attitude (error on its own side) and the position of the first camera in its axes.
pub(crate) const SECOND_INTRINSICS: usize = GYRO_SCALE + 3;
pub(crate) const SECOND_ATTITUDE: usize = SECOND_INTRINSICS + intrinsics::INTRINSICS;
pub(crate) const SECOND_POSITION: usize = SECOND_ATTITUDE + 3;
/// Rows before the first landmark, at most.
pub(crate) const MAX_HEAD: usize = SECOND_POSITION + 3;
/// Rows of a landmark: two of the bearing, one of the inverse distance.
pub(crate) const LANDMARK_SIZE: usize = 3;

/// Row of what [`ImuPreintegration::by_calibration`](crate::inertial::preintegration::ImuPreintegration) derives by, in its order.
pub(crate) const fn imu_calibration(column: usize) -> usize {
    if column < MATRIX_SIZE { ACCEL_MATRIX + column } else { GYRO_SCALE + column - MATRIX_SIZE }
}

/// First row of a landmark, after so many rows.
pub(crate) const fn landmark(head: usize, slot: usize) -> usize {
    head + LANDMARK_SIZE * slot
}

/// Rows of a landmark's bearing, of the time offset, and, where there is room for them, of the intrinsics and the time of a row.
pub(crate) fn bearing_and_camera<const C: usize>(landmark: usize) -> [usize; C] {
    std::array::from_fn(|k| match k {
        0 | 1 => landmark + k,
        2 => TIME_OFFSET,
        k => INTRINSICS + k - 3,
    })
}
