//! The nominal state of the odometry and the rows of its errors.

pub(crate) mod bearing;
pub mod error_state;
pub(crate) mod inverse_distance;
pub(crate) mod landmark;
pub(crate) mod rolling_shutter;
pub(crate) mod vio_state;
