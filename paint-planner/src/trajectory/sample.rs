//! A trajectory at one instant, and its extremes.

use nalgebra::{Point3, Vector3};

/// The vehicle at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Body origin in the world, m.
    pub position: Point3<f64>,
    /// Velocity in the world, m/s.
    pub velocity: Vector3<f64>,
    /// Acceleration in the world, m/s^2.
    pub acceleration: Vector3<f64>,
    /// Heading about world z, rad, continuous (not wrapped).
    pub heading: f64,
    /// Heading rate, rad/s.
    pub heading_rate: f64,
}

/// Certified bounds over a stretch of trajectory: never below the true maxima, and above them by at most 1e-6 of them.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Extrema {
    /// Greatest speed, m/s.
    pub speed: f64,
    /// Greatest acceleration, m/s^2.
    pub acceleration: f64,
    /// Greatest absolute heading rate, rad/s.
    pub heading_rate: f64,
}
