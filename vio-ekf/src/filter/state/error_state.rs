//! First row of each block of the odometry's error state.
//!
//! ```text
//! rows   0  3  6  9  12 | 15       18       21      22           23           | 32 + 3 k
//!        p  v  R  b_g b_a | camera's pose  offset  depth prior  accel. matrix | landmark k: bearing (2), inverse distance (1)
//! ```

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
/// Rows before the first landmark.
pub(crate) const FIRST_LANDMARK: usize = 32;
/// Rows of a landmark: two of the bearing, one of the inverse distance.
pub(crate) const LANDMARK_SIZE: usize = 3;

/// First row of a landmark.
pub(crate) const fn landmark(slot: usize) -> usize {
    FIRST_LANDMARK + LANDMARK_SIZE * slot
}

/// Rows of a landmark's bearing and of the time offset.
pub(crate) fn bearing_and_time(slot: usize) -> [usize; 3] {
    let row = landmark(slot);
    [row, row + 1, TIME_OFFSET]
}
