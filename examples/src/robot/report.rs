//! The figures of a flight.

use serde::Serialize;

use crate::report::LocalisationReport;

/// What `report.json` of `robot` holds; SI units. The figures of the machine stand at its end, all others are the same in every run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RobotReport {
    /// Version of this program.
    pub version: &'static str,
    /// Seed of design, wind and errors.
    pub seed: u64,
    /// Set-points that were sent.
    pub setpoints: String,
    /// How the flight ended.
    pub ended: String,
    /// Time of the plan that was painted.
    pub painted_s: f64,
    /// Simulated time from the start of the autopilot to the end.
    pub flight_s: f64,
    /// Hit error of the spray, root mean square.
    pub hit_error_rms_m: f64,
    /// The hit error that 95 % of the samples do not exceed.
    pub hit_error_p95_m: f64,
    /// True position against the plan's while painting, root mean square.
    pub position_error_rms_m: f64,
    /// Estimated against true position, root mean square.
    pub localisation_error_rms_m: f64,
    /// Distance from nozzle to surface, standard deviation of its error.
    pub nozzle_distance_std_m: f64,
    /// Share of the samples with paint asked for in which the valve was kept shut.
    pub valve_held_share: f64,
    /// Control steps with the valve commanded open one step after the cause of a failsafe.
    pub valve_open_late_count: usize,
    /// Holds in flight.
    pub holds: usize,
    /// Moments at which the plan exceeds a limit, or the flown gun its joint limits.
    pub limit_violations: usize,
    /// Moments at which the robot touched the surface.
    pub collisions: usize,
    /// Largest tilt while painting.
    pub max_tilt_rad: f64,
    /// Paint that left the nozzle.
    pub paint_emitted_kg: f64,
    /// Paint on the surface.
    pub paint_deposited_kg: f64,
    /// Simulated over wall time of the flight alone.
    pub simulated_over_wall_time: f64,
    /// Processor time of the autopilot per simulated second.
    pub autopilot_cpu_s_per_s: f64,
    /// Processor time of this program per simulated second.
    pub robot_cpu_s_per_s: f64,
    /// What the robot's own localisation was worth, if it flew by that.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub localisation: Option<LocalisationReport>,
}

impl RobotReport {
    /// The main figures on a few lines.
    pub fn summary(&self) -> String {
        format!(
            "  {}: {:.0} s of the plan painted in {:.0} s\n  hit error {:.2} cm RMS, {:.2} cm 95 %; position {:.2} cm; valve kept shut {:.1} %\n  \
             {} holds, {} limit violations, {} collisions, valve open late {} times\n  {:.1} times as fast as the wall clock; per second {:.3} s of \
             processor for the autopilot, {:.3} s for this program",
            self.ended,
            self.painted_s,
            self.flight_s,
            100.0 * self.hit_error_rms_m,
            100.0 * self.hit_error_p95_m,
            100.0 * self.position_error_rms_m,
            100.0 * self.valve_held_share,
            self.holds,
            self.limit_violations,
            self.collisions,
            self.valve_open_late_count,
            self.simulated_over_wall_time,
            self.autopilot_cpu_s_per_s,
            self.robot_cpu_s_per_s,
        )
    }
}
