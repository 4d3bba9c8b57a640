//! What the robot's own localisation was worth.

use serde::Serialize;

use crate::onboard::LocalisationFigures;

/// Over all flights that paint.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LocalisationReport {
    /// Position error, root mean square.
    pub position_error_rms_m: f64,
    /// Longest time from the first image of a flight to the first pose.
    pub relocalised_after_s: f64,
    /// Largest error of such a pose.
    pub relocalisation_error_max_m: f64,
    /// Depth images that gave no pose in the map, of all.
    pub unconfirmed_depth_share: f64,
    /// Processor time of odometry and localisation for a second of flight.
    pub onboard_cpu_s_per_s: f64,
}

impl LocalisationReport {
    /// Of flights of so many seconds together.
    pub fn of(told: &LocalisationFigures, flight_time: f64) -> Self {
        Self {
            position_error_rms_m: told.position_error_rms_m(),
            relocalised_after_s: told.relocalised_after_s,
            relocalisation_error_max_m: told.relocalisation_error_m,
            unconfirmed_depth_share: told.unconfirmed as f64 / told.depth_images.max(1) as f64,
            onboard_cpu_s_per_s: told.cpu.as_secs_f64() / flight_time,
        }
    }
}
