//! Whether inertial samples can be what they claim to be: order, rate, units and axes, by themselves, beside images, and by running
//! the odometry with other readings.

mod accelerometer;
mod axes;
mod bias_at_rest;
mod clipping;
mod diagnosis;
mod gyroscope;
mod images;
mod reading;
mod seen_image;
mod signed_axes;
mod static_view;
mod validation;
mod window;

pub use axes::{AxesCheck, check_imu_axes};
pub use diagnosis::{AxesDiagnosis, MisreadSensor, diagnose_axes};
pub use images::check_axes_with_images;
pub use reading::AxesReading;
pub(crate) use validation::gravity_scale;
pub use validation::{ImuValidation, ImuWarning, validate_samples};
pub use window::busiest_window;
