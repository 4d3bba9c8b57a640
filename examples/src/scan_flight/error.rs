//! Why a surface could not be scanned.

use vio_ekf::Status;

/// Why a surface could not be scanned.
#[derive(Debug, thiserror::Error)]
pub enum ScanFlightError {
    /// It has no front to fly along.
    #[error("the surface closes in on itself: a scan flies along surfaces that face one side; paint it without --scan")]
    NoFront,
    /// It is too small or too large for the flight.
    #[error(
        "the surface is {width:.1} m by {height:.1} m: a scan wants 0.5 to 30 m; change its scale, or paint it without --scan"
    )]
    Size {
        /// Along the flight, metres.
        width: f64,
        /// Upwards, metres.
        height: f64,
    },
    /// The odometry did not start or gave up.
    #[error(
        "the odometry did not come to an end ({0:?}): the surface may be too plain to be followed; paint it without --scan"
    )]
    Lost(Status),
    /// The sensors' simulation or the odometry refused.
    #[error("odometry: {0}")]
    Odometry(#[from] vio_ekf::Error),
    /// The map refused.
    #[error("map: {0}")]
    Map(#[from] tsdf_hash::Error),
    /// The renderer refused.
    #[error("camera: {0}")]
    Camera(#[from] paint_sim::Error),
}
