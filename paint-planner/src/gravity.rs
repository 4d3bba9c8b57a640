//! Gravity.

/// Standard gravity, m/s² (ISO 80000-3).
pub(crate) const GRAVITY: f64 = 9.80665;
