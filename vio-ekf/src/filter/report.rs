//! What the filter reports about itself and about each image.

use nalgebra::{Isometry3, SMatrix};

use crate::core::divergence::DivergenceCause;

/// Whether the estimate can be used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    /// Not initialised yet, and why.
    Uninitialised(InitializationStatus),
    /// Running.
    Tracking,
    /// Given up, and why. Stays so until [`Vio::initialize`](crate::Vio::initialize) or [`Vio::reset`](crate::Vio::reset).
    Diverged(DivergenceCause),
}

/// What the initialization at rest waits for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum InitializationStatus {
    /// A second in which rate and force do not change.
    WaitingForSteadyImu,
    /// Images with corners, and without parallax.
    WaitingForStationaryImages,
    /// The force read at rest is not gravity: axes, units or calibration of the accelerometer are wrong.
    GravityMismatch,
}

/// The camera's calibration as the filter estimates it.
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
    /// Landmarks whose measurement failed, or was an outlier.
    pub rejected: usize,
    /// Landmarks that were new.
    pub added: usize,
    /// Landmarks that were dropped.
    pub removed: usize,
    /// Whether the body was taken to be stationary.
    pub stationary: bool,
}

impl FrameReport {
    /// Nothing yet.
    pub(crate) fn empty(status: Status) -> Self {
        Self { status, used: 0, rejected: 0, added: 0, removed: 0, stationary: false }
    }
}
