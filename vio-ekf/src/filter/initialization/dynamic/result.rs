//! The outcome of an initialization in motion.

use nalgebra::{SMatrix, SVector, UnitQuaternion, Vector3};

use super::window::ERRORS;
use crate::inertial::error_state;

/// State at the end of the window. Errors of the core and of the distances are those of the window's unknowns and of its samples, times
/// their derivatives.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct InitialMotion {
    /// Velocity in body axes.
    pub(crate) velocity: Vector3<f64>,
    /// Attitude of the body in a world whose z axis points up; the yaw is arbitrary.
    pub(crate) attitude: UnitQuaternion<f64>,
    pub(crate) gyro_bias: Vector3<f64>,
    pub(crate) accel_bias: Vector3<f64>,
    /// Covariance of the errors of the window.
    pub(crate) covariance: SMatrix<f64, ERRORS, ERRORS>,
    /// Errors of the core by theirs.
    pub(crate) core: SMatrix<f64, { error_state::CORE }, ERRORS>,
    /// The points that the last image sees.
    pub(crate) landmarks: Vec<InitialDistance>,
    /// Relative standard deviation of the scale, the noise of the samples apart.
    pub(crate) scale_sigma: f64,
    /// Length of the window, s.
    pub(crate) duration: f64,
    /// White noise of the gyroscope, rad/s/√Hz.
    pub(crate) gyro_density: f64,
}

/// Inverse distance of a point at the last image.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct InitialDistance {
    /// Index among the window's points, and id.
    pub(crate) point: usize,
    pub(crate) id: u64,
    pub(crate) inverse_distance: f64,
    /// Variance of its own, independent of all else.
    pub(crate) variance: f64,
    /// Derivative by the errors of the window: what it has in common with all else.
    pub(crate) gradient: SVector<f64, ERRORS>,
}

/// What came of a window.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum DynamicOutcome {
    /// The motion is known.
    Converged(Box<InitialMotion>),
    /// Nothing contradicts, but the scale is not known well enough yet: in hover and in straight flight at constant speed no
    /// camera can know it.
    Unobservable,
    /// The points contradict each other or the samples.
    Inconsistent,
}
