use nalgebra::{Isometry3, SMatrix, Vector3};

use super::CoreCovariance;
use crate::Stamp;

/// Whether the estimate can be used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    /// No start yet, and why.
    Uninitialised(Waiting),
    /// Running.
    Tracking,
    /// Given up, and why. Stays so until [`Vio::start`](crate::Vio::start) or [`Vio::reset`](crate::Vio::reset).
    Diverged(Excess),
}

/// What the start at rest waits for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Waiting {
    /// A second without shaking, by the inertial samples.
    ForSteadiness,
    /// Images that have something to hold on to, and in which nothing moves.
    ForStillImages,
    /// The force read at rest is not gravity: axes, units or calibration of the accelerometer are wrong.
    ForGravity,
}

/// Which limit of [`LimitSettings`](crate::LimitSettings) was exceeded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Excess {
    /// The speed, or a number that is not finite.
    Speed,
    /// A bias.
    Bias,
    /// The uncertainty of the velocity.
    Uncertainty,
    /// Landmarks contradict the prediction, image after image.
    Contradiction,
}

/// An estimate of the body's motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Odometry {
    /// Its time, by the inertial sensor's clock.
    pub stamp: Stamp,
    /// Pose; z of the world is up.
    pub world_from_body: Isometry3<f64>,
    /// Velocity in body axes, m/s.
    pub velocity_in_body: Vector3<f64>,
    /// Angular rate in body axes, rad/s.
    pub rate_in_body: Vector3<f64>,
    /// Bias of the gyroscope, rad/s.
    pub gyro_bias: Vector3<f64>,
    /// Bias of the accelerometer, m/s².
    pub accel_bias: Vector3<f64>,
    /// Of the errors of, in this order, three rows each: position in world axes; velocity in body axes; attitude as a
    /// rotation vector in **world** axes, `R_true = Exp(δθ) R`; gyroscope's bias; accelerometer's bias.
    pub covariance: CoreCovariance,
}

impl Odometry {
    /// Covariance of the attitude error as a rotation vector in body axes, rad².
    pub fn attitude_covariance_in_body(&self) -> nalgebra::Matrix3<f64> {
        let rotation = self.world_from_body.rotation.to_rotation_matrix().into_inner();
        let world: SMatrix<f64, 3, 3> = self.covariance.fixed_view::<3, 3>(6, 6).into_owned();
        rotation.transpose() * world * rotation
    }
}

/// The camera's calibration as the filter sees it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Calibration {
    /// Pose of the camera on the body.
    pub body_from_camera: Isometry3<f64>,
    /// Seconds to add to the camera's stamps to get the inertial sensor's time.
    pub time_offset_s: f64,
    /// Of the errors of, in this order: position (m), attitude as a rotation vector in **body** axes (rad), time offset (s).
    pub covariance: SMatrix<f64, 7, 7>,
}

/// What one image, or one set of points, did.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FrameReport {
    /// Whether the estimate can be used.
    pub status: Status,
    /// Landmarks whose measurement was used.
    pub used: usize,
    /// Landmarks whose measurement was refused.
    pub rejected: usize,
    /// Landmarks that were new.
    pub added: usize,
    /// Landmarks that were dropped.
    pub removed: usize,
    /// Whether the body was taken to be at rest.
    pub at_rest: bool,
}
