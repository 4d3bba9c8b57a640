//! The odometry: a camera, maybe a second one, an inertial sensor, and an iterated extended Kalman filter around the body.

mod accel_matrix_selection;
pub(crate) mod calibration_error;
mod calibration_prior;
mod depth_prior;
mod divergence_monitor;
mod estimator;
pub(crate) mod frontend;
mod image_tracking;
mod initialization;
mod initializing;
mod innovation_adaptation;
mod landmarks;
pub(crate) mod measurements;
pub(crate) mod point_observation;
mod point_tracking;
mod propagation;
pub(crate) mod report;
mod running;
mod sensors;
pub(crate) mod settings;
pub(crate) mod state;
mod stationary;
pub(crate) mod stereo;
mod tracking_state;
pub(crate) mod vio;

pub use frontend::point_tracker::PointTracker;
pub use measurements::measurement::{Measurement, Trial};
pub use measurements::pose::BodyPose;
pub use point_observation::{PointObservation, PointPair};
pub use report::{Calibration, FrameReport, InitializationStatus, LandmarkEstimate, Status};
pub use settings::{
    CalibrationSettings, DynamicInitializationSettings, LandmarkSettings, PatchSettings, Settings, StationarySettings,
    StereoSettings, UpdateSettings,
};
pub use state::bearing::Bearing;
pub use state::error_state;
pub use state::vio_state::VioState;
pub use vio::Vio;
