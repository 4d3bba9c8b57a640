//! What the comparison can be told.

use clap::Parser;

/// Compares the cascade of two filters with one filter on the same simulated flights.
#[derive(Parser)]
#[command(after_help = "Example: vio_fusion --flights 10 --seconds 60 --coarse 3")]
pub(crate) struct Arguments {
    /// Flights, with seeds 1, 2, ...: another motion, another room, other noise
    #[arg(long, default_value_t = 10)]
    pub(crate) flights: u64,
    /// The first of the seeds
    #[arg(long, default_value_t = 1)]
    pub(crate) first_seed: u64,
    /// Seconds of each flight
    #[arg(long, default_value_t = 60.0)]
    pub(crate) seconds: f64,
    /// Seconds after the start that do not count: its errors are drawn, the same for all
    #[arg(long, default_value_t = 5.0)]
    pub(crate) settle: f64,
    /// Noise of the autopilot's inertial sensor, in units of that of the sensor head (ADIS16448)
    #[arg(long, default_value_t = 3.0)]
    pub(crate) coarse: f64,
    /// Delay of the map's poses, s
    #[arg(long, default_value_t = 0.1)]
    pub(crate) delay: f64,
    /// What the cascade assumes of the odometry's poses: white noise, m
    #[arg(long, default_value_t = 0.01)]
    pub(crate) odometry_sigma_m: f64,
    /// White noise, rad
    #[arg(long, default_value_t = 0.01)]
    pub(crate) odometry_sigma_rad: f64,
    /// Drift of the position, m/√s
    #[arg(long, default_value_t = 0.01)]
    pub(crate) odometry_walk_m: f64,
    /// Drift of the yaw, rad/√s
    #[arg(long, default_value_t = 0.0005)]
    pub(crate) odometry_walk_rad: f64,
}
