//! What every filter around an inertial sensor needs: the 15 core states, preintegration, buffers for late measurements, the
//! iterated update and the divergence test. [`Vio`](crate::Vio) and [`PoseFusion`](crate::PoseFusion) are built on it.

pub(crate) mod core_state;
pub(crate) mod covariance;
pub(crate) mod divergence;
pub(crate) mod error_state;
pub(crate) mod imu_buffer;
pub(crate) mod imu_noise_estimator;
pub(crate) mod information;
pub(crate) mod initial_state;
pub(crate) mod iterated_update;
pub(crate) mod odometry;
pub(crate) mod preintegration;
