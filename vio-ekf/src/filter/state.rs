use nalgebra::{Matrix2, UnitQuaternion, Vector2, Vector3};

use super::bearing::Bearing;
use super::distance::InverseDistance;
use crate::so3;

/// First row of each block of the error state. The blocks after the core are the camera's pose on the body and the
/// offset of its clock, then what the landmarks have in common; they follow, three rows each.
pub(crate) mod at {
    /// Position error in world axes.
    pub(crate) const POSITION: usize = 0;
    /// Error of the body's velocity, in body axes.
    pub(crate) const VELOCITY: usize = 3;
    /// Attitude error on the world's side: `R ← Exp(δθ) R`.
    pub(crate) const ATTITUDE: usize = 6;
    /// Bias of the gyroscope.
    pub(crate) const GYRO_BIAS: usize = 9;
    /// Bias of the accelerometer.
    pub(crate) const ACCEL_BIAS: usize = 12;
    /// Rows of the core: what an inertial sensor alone has.
    pub(crate) const CORE: usize = 15;
    /// Position of the camera on the body.
    pub(crate) const CAMERA_POSITION: usize = 15;
    /// Attitude of the camera on the body, error on the body's side.
    pub(crate) const CAMERA_ATTITUDE: usize = 18;
    /// Time offset of the camera.
    pub(crate) const TIME_OFFSET: usize = 21;
    /// Inverse distance that is expected of new landmarks.
    pub(crate) const EXPECTED: usize = 22;
    /// Rows before the first landmark.
    pub(crate) const HEAD: usize = 23;
    /// Rows of a landmark: two of the bearing, one of the inverse distance.
    pub(crate) const LANDMARK: usize = 3;

    /// First row of a landmark.
    pub(crate) const fn landmark(slot: usize) -> usize {
        HEAD + LANDMARK * slot
    }
}

/// The nominal state.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct State {
    /// Position of the body in the world.
    pub(crate) position: Vector3<f64>,
    /// Velocity of the body against the world, in body axes.
    pub(crate) velocity: Vector3<f64>,
    /// Attitude, `world_from_body`.
    pub(crate) attitude: UnitQuaternion<f64>,
    pub(crate) gyro_bias: Vector3<f64>,
    pub(crate) accel_bias: Vector3<f64>,
    /// Position of the camera on the body.
    pub(crate) camera_position: Vector3<f64>,
    /// Attitude of the camera, `body_from_camera`.
    pub(crate) camera_attitude: UnitQuaternion<f64>,
    /// Seconds to add to a camera's stamp to get the inertial sensor's time.
    pub(crate) time_offset: f64,
    /// Inverse distance that is expected of new landmarks, 1/m: a landmark's own differs from it independently of the others', so
    /// that all together know no more of the scale than the scene does.
    pub(crate) expected: InverseDistance,
    pub(crate) landmarks: Vec<Landmark>,
}

/// A point of the scene in the axes of the camera that sees it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Landmark {
    pub(crate) bearing: Bearing,
    /// `ρ = 1/d`, 1/m.
    pub(crate) inverse_distance: InverseDistance,
    /// Tangent coordinates per pixel of the patch as it was taken: how the patch has been deformed since.
    pub(crate) warp: Matrix2<f64>,
}

impl State {
    /// `x ← x ⊞ δ`.
    pub(crate) fn correct(&mut self, delta: &[f64]) {
        let block = |row: usize| Vector3::new(delta[row], delta[row + 1], delta[row + 2]);
        self.position += block(at::POSITION);
        self.velocity += block(at::VELOCITY);
        self.attitude = turned(&block(at::ATTITUDE), &self.attitude);
        self.gyro_bias += block(at::GYRO_BIAS);
        self.accel_bias += block(at::ACCEL_BIAS);
        self.camera_position += block(at::CAMERA_POSITION);
        self.camera_attitude = turned(&block(at::CAMERA_ATTITUDE), &self.camera_attitude);
        self.time_offset += delta[at::TIME_OFFSET];
        self.expected.correct(delta[at::EXPECTED]);
        for (landmark, d) in self.landmarks.iter_mut().zip(delta[at::HEAD..].chunks_exact(at::LANDMARK)) {
            landmark.bearing = landmark.bearing.boxplus(&Vector2::new(d[0], d[1]));
            landmark.inverse_distance.correct(d[2]);
        }
    }
}

/// `Exp(δ) R`.
fn turned(delta: &Vector3<f64>, rotation: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::new_normalize((so3::exp(delta) * rotation).into_inner())
}
