//! What the filter reports about itself and about each image.

use std::fmt;

use nalgebra::{Isometry3, Matrix3, SMatrix, Unit, Vector2, Vector3};

use crate::camera::Camera;
use crate::inertial::divergence::DivergenceCause;

/// Whether the estimate can be used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Status {
    /// Not initialised yet, and why.
    Uninitialised(InitializationStatus),
    /// Running, on landmarks or at rest.
    Tracking,
    /// Running on inertial samples alone: the last image followed no landmark, or there has been none for a while. The covariance
    /// grows, and says how far the estimate can be used.
    DeadReckoning,
    /// Given up, and why. Stays so until [`Vio::initialize`](crate::Vio::initialize) or [`Vio::reset`](crate::Vio::reset).
    Diverged(DivergenceCause),
}

/// What the initialization waits for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum InitializationStatus {
    /// A second in which rate and force do not change.
    WaitingForSteadyImu,
    /// Images with corners: what the camera sees is dark, blurred or bare.
    WaitingForFeatures,
    /// Images without parallax: the inertial samples are at rest, the images move.
    WaitingForStationaryImages,
    /// The force read at rest is not gravity: axes, units or calibration of the accelerometer are wrong.
    GravityMismatch,
}

/// The calibration of camera and accelerometer as the filter estimates it.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Calibration {
    /// Pose of the camera on the body.
    pub body_from_camera: Isometry3<f64>,
    /// Seconds to add to the camera's stamps to get the inertial sensor's time.
    pub time_offset_s: f64,
    /// The first camera with the intrinsics that are estimated; `None` where they are not.
    pub camera: Option<Camera>,
    /// The second camera likewise; its pose is that which follows from both estimates.
    pub second_camera: Option<Camera>,
    /// Of the errors of, in this order: position (m), attitude as a rotation vector in **body** axes (rad), time offset (s).
    pub covariance: SMatrix<f64, 7, 7>,
    /// The matrix `A` of the accelerometer, which reads `A⁻¹` of the specific force; the identity where it is not estimated
    /// ([`ImuSettings::accel_scale_sigma`](crate::inertial::ImuSettings::accel_scale_sigma)).
    pub accel_matrix: Matrix3<f64>,
    /// Standard deviation of each of its entries.
    pub accel_matrix_sigma: Matrix3<f64>,
    /// Time from the exposure of a row of the first camera until that of the row below, s.
    pub row_time_s: f64,
    /// Its standard deviation; 0 where it is not estimated ([`CalibrationSettings::row_time_sigma_s`](crate::filter::CalibrationSettings::row_time_sigma_s)).
    pub row_time_sigma_s: f64,
    /// Rate by what the gyroscope reads, axis by axis; one where that is not estimated
    /// ([`ImuSettings::gyro_scale_sigma`](crate::inertial::ImuSettings::gyro_scale_sigma)).
    pub gyro_scale: Vector3<f64>,
    /// Its standard deviation.
    pub gyro_scale_sigma: Vector3<f64>,
}

/// A landmark as the filter estimates it at the last image.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct LandmarkEstimate {
    /// Its number; that of the caller's point where the points are the caller's.
    pub id: u64,
    /// Direction in the axes of the first camera.
    pub bearing_in_camera: Unit<Vector3<f64>>,
    /// Where that is in the image; `None` where the lens has no pixel for it.
    pub pixel: Option<Vector2<f64>>,
    /// One over the distance from the camera, 1/m.
    pub inverse_distance: f64,
    /// Its standard deviation, 1/m.
    pub inverse_distance_sigma: f64,
    /// Images in a row that it could not be measured in.
    pub failures: u32,
}

/// What one image, or one set of points, did.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
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
    /// Images in a row, this one included, in which most landmarks contradicted the prediction. What was estimated since the first
    /// of them is in doubt.
    pub consecutive_outliers: u32,
}

impl fmt::Display for InitializationStatus {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::WaitingForSteadyImu => {
                "there was no second of rest to start from, and no motion that tells the scale"
            }
            Self::WaitingForStationaryImages => {
                "the images move while the inertial sensor is at rest: check that both are of the same flight and clock"
            }
            Self::WaitingForFeatures => "the images show nothing to track: they are dark, blurred or bare",
            Self::GravityMismatch => {
                "gravity test: at rest the accelerometer does not read gravity; check its axes, unit and calibration"
            }
        })
    }
}

impl Status {
    /// Whether there is an estimate: [`Tracking`](Self::Tracking) or [`DeadReckoning`](Self::DeadReckoning).
    pub fn has_estimate(self) -> bool {
        matches!(self, Self::Tracking | Self::DeadReckoning)
    }
}

impl FrameReport {
    /// Nothing yet.
    pub(crate) fn empty(status: Status) -> Self {
        Self { status, used: 0, rejected: 0, added: 0, removed: 0, stationary: false, consecutive_outliers: 0 }
    }
}
