//! The figures of flights.

use paint_planner::onboard::Phase;
use paint_sim::flight::FlightSample;
use serde::Serialize;

use super::flight::Flown;
use super::recorder::Record;
use crate::mission::{Flight, FlownFigures, Purpose, SavedReport};
use crate::report::LocalisationReport;

/// One flight on the autopilot; SI units. The figures of the machine stand at its end, all others are the same in every run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FlightReport {
    /// What it was for.
    pub purpose: Purpose,
    /// How it ended.
    pub ended: String,
    /// Time of the plan that was painted, or of the way that was flown to look.
    pub painted_s: f64,
    /// Simulated time from the start of the autopilot to the end.
    pub flight_s: f64,
    /// Hit error of the spray, root mean square.
    pub hit_error_rms_m: f64,
    /// The hit error that 95 % of the samples do not exceed.
    pub hit_error_p95_m: f64,
    /// The largest hit error.
    pub hit_error_max_m: f64,
    /// True position against the plan's while painting, root mean square.
    pub position_error_rms_m: f64,
    /// Estimated against true position while it paints or looks, root mean square.
    pub localisation_error_rms_m: f64,
    /// Distance from nozzle to surface, standard deviation of its error.
    pub nozzle_distance_std_m: f64,
    /// Share of the samples with paint asked for in which the valve was kept shut.
    pub valve_held_share: f64,
    /// Control steps with the valve commanded open one step after the cause of a failsafe.
    pub valve_open_late_count: usize,
    /// Holds in flight.
    pub holds: usize,
    /// Moments at which the robot touched the surface.
    pub collisions: usize,
    /// Largest tilt while painting.
    pub max_tilt_rad: f64,
    /// Simulated over wall time of the flight alone.
    pub simulated_over_wall_time: f64,
    /// Processor time of the autopilot per simulated second.
    pub autopilot_cpu_s_per_s: f64,
    /// Processor time of this program per simulated second.
    pub robot_cpu_s_per_s: f64,
}

impl FlightReport {
    /// Of a flight that took so long, by the wall clock and of the processor, s.
    pub(super) fn of(flight: &Flight, flown: &Flown, [wall, cpu]: [f64; 2]) -> Self {
        let Record { painting, ways, events, .. } = &flown.record;
        let statistics = painting.statistics();
        let asked = painting.samples.iter().filter(|s| s.held || s.flow > 0.0).count();
        Self {
            purpose: flight.purpose,
            ended: flown.failed.clone().unwrap_or_else(|| "landed".into()),
            painted_s: painting.samples.last().map_or(0.0, |sample| sample.time),
            flight_s: flown.seconds,
            hit_error_rms_m: statistics.hit_error_rms,
            hit_error_p95_m: statistics.hit_error_p95,
            hit_error_max_m: statistics.hit_error_max,
            position_error_rms_m: statistics.position_error_rms,
            localisation_error_rms_m: match flight.purpose {
                Purpose::Paint => statistics.localisation_error_rms,
                Purpose::Look => believed_position_error(&painting.samples),
            },
            nozzle_distance_std_m: statistics.nozzle_distance_std,
            valve_held_share: statistics.held_samples as f64 / asked.max(1) as f64,
            valve_open_late_count: flown.valve_open_late,
            holds: events.iter().filter(|(_, phase)| matches!(phase, Phase::Hold(_))).count(),
            collisions: flight.collisions(painting) + flight.collisions(ways),
            max_tilt_rad: statistics.max_tilt,
            simulated_over_wall_time: flown.seconds / wall,
            autopilot_cpu_s_per_s: flown.px4_cpu / flown.seconds,
            robot_cpu_s_per_s: cpu / flown.seconds,
        }
    }

    /// Why its paint is not what was planned: the valve was kept shut for most of it.
    pub(super) fn mostly_shut(&self) -> Option<String> {
        let percent = 100.0 * self.valve_held_share;
        (percent > 50.0).then(|| format!("the valve was kept shut for {percent:.0} % of the paint"))
    }

    /// The main figures on a few lines.
    pub fn summary(&self) -> String {
        let what = match self.purpose {
            Purpose::Paint => format!(
                "of the plan painted in {:.0} s\n  hit error {:.2} cm RMS, {:.2} cm 95 %; position {:.2} cm; valve kept shut {:.1} %",
                self.flight_s,
                100.0 * self.hit_error_rms_m,
                100.0 * self.hit_error_p95_m,
                100.0 * self.position_error_rms_m,
                100.0 * self.valve_held_share,
            ),
            Purpose::Look => format!(
                "along the surface, to look, in {:.0} s; believed position off by {:.2} cm",
                self.flight_s,
                100.0 * self.localisation_error_rms_m
            ),
        };
        format!(
            "  {}: {:.0} s {what}\n  {} holds, {} collisions, valve open late {} times\n  {:.1} times as fast as the wall clock; per second \
             {:.3} s of processor for the autopilot, {:.3} s for this program",
            self.ended,
            self.painted_s,
            self.holds,
            self.collisions,
            self.valve_open_late_count,
            self.simulated_over_wall_time,
            self.autopilot_cpu_s_per_s,
            self.robot_cpu_s_per_s,
        )
    }
}

/// Root mean square over samples, painted or not, m.
fn believed_position_error(samples: &[FlightSample]) -> f64 {
    let square = |s: &FlightSample| (s.world_from_body.translation.vector - s.estimated_position.coords).norm_squared();
    (samples.iter().map(square).sum::<f64>() / samples.len().max(1) as f64).sqrt()
}

/// What `report.json` of `robot --seconds`, and of a flight on a vehicle, holds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TrialReport {
    /// Version of this program.
    pub version: &'static str,
    /// Seed of design, wind and errors.
    pub seed: u64,
    /// Set-points that were sent.
    pub setpoints: String,
    /// What the flight was worth.
    #[serde(flatten)]
    pub flown: FlownFigures,
    /// The flight.
    #[serde(flatten)]
    pub flight: FlightReport,
    /// What the robot's own localisation was worth, if it flew by that.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub localisation: Option<LocalisationReport>,
}

/// What `report.json` of a whole mission on the autopilot holds: all that `paintcopter` says of it, and every flight.
#[derive(Debug, Serialize)]
pub struct RobotReport<'a> {
    /// The mission.
    #[serde(flatten)]
    pub mission: &'a SavedReport,
    /// Set-points that were sent.
    pub setpoints: String,
    /// The flights in their order.
    pub flights: &'a [FlightReport],
}
