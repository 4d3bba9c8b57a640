//! What happened while it painted.

use nalgebra::{Isometry3, Point3};
use paint_planner::gantry::GantryPlan;
use paint_sim::droplets::Coverage;

/// The robot at one moment.
#[derive(Debug, Clone, Copy)]
pub struct Tick {
    /// Seconds since the start.
    pub time: f64,
    /// True pose of the robot.
    pub world_from_robot: Isometry3<f64>,
    /// True position of the nozzle on its slide, m.
    pub position: f64,
    /// Share of the tick in which paint flies.
    pub open: f64,
    /// Whether the pose was measured.
    pub tracked: bool,
    /// Where the spray axis meets the object.
    pub hit: Option<Point3<f64>>,
}

/// What happened.
pub struct SessionLog {
    /// Every hundredth of a second.
    pub ticks: Vec<Tick>,
    /// Messages with their times, s.
    pub messages: Vec<(f64, String)>,
    /// The paint on the true object.
    pub truth: Coverage,
    /// The paint as the robot believes it to be.
    pub belief: Coverage,
    /// Paint that left the nozzle, m^3.
    pub emitted: f64,
    /// Decisions, wall-clock ms.
    pub decision_ms: Vec<f64>,
    /// Decisions in which nothing could be painted within the horizon.
    pub idle_decisions: usize,
    /// Decisions that fell out because the robot was not tracked.
    pub held_decisions: usize,
    /// Ticks without a pose.
    pub lost_ticks: usize,
    /// Measured poses so far from the expected ones that the filter started anew.
    pub pose_jumps: usize,
    /// Longest time between the loss of the markers and a shut valve's command, s.
    pub shut_after_loss: f64,
    /// Times that the nozzle ran into a limit switch.
    pub limit_hits: usize,
    /// Times that the valve was switched.
    pub valve_switches: usize,
    /// Error of the believed place of the object at the end, m.
    pub registration_error: f64,
    /// Root mean square error of the believed position of the robot while tracked, m.
    pub position_error_rms: f64,
    /// The decision with the largest score, with the paint as it was.
    pub best_plan: Option<GantryPlan>,
}

impl SessionLog {
    /// Time from one moment of the log to the next, s.
    pub fn tick(&self) -> f64 {
        self.ticks.get(1).map_or(0.0, |second| second.time - self.ticks[0].time)
    }

    /// Length of the painting, s.
    pub fn duration(&self) -> f64 {
        self.tick() * self.ticks.len() as f64
    }
}
