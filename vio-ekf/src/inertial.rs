//! What every filter around an inertial sensor needs: the 15 core states, preintegration, buffers for late measurements, the
//! iterated update and the divergence test; and dead reckoning, which needs no more. [`Vio`](crate::Vio) and
//! [`PoseFusion`](crate::fusion::PoseFusion) are built on it.

pub(crate) mod core_state;
pub(crate) mod covariance;
pub(crate) mod dead_reckoning;
pub(crate) mod divergence;
pub(crate) mod error_state;
pub(crate) mod imu_buffer;
pub(crate) mod imu_noise_estimator;
pub(crate) mod information;
pub(crate) mod initial_state;
pub(crate) mod iterated_update;
pub(crate) mod odometry;
pub(crate) mod preintegration;

pub use core_state::{CoreCovariance, CoreState};
pub use dead_reckoning::InertialOdometry;
pub use divergence::{DivergenceCause, DivergenceSettings};
pub use imu_noise_estimator::{AccelMatrixEstimation, ImuSettings};
pub use initial_state::{InitialSigma, InitialState};
pub use iterated_update::Linearization;
pub use odometry::Odometry;
