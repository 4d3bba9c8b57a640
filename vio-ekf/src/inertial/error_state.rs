//! Rows of the core error state: what an inertial sensor alone has.

/// Position error in world axes, m.
pub const POSITION: usize = 0;
/// Error of the body's velocity, in body axes, m/s.
pub const VELOCITY: usize = 3;
/// Attitude error on the world's side, rad: `R ← Exp(δθ) R`.
pub const ATTITUDE: usize = 6;
/// Bias of the gyroscope, rad/s.
pub const GYRO_BIAS: usize = 9;
/// Bias of the accelerometer, m/s².
pub const ACCEL_BIAS: usize = 12;
/// Number of rows of the core.
pub const CORE: usize = 15;
