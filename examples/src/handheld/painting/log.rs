//! What happened while it painted.

use std::time::Duration;

use nalgebra::{Isometry3, Point3};
use paint_planner::gantry::{Command, Event, Frame, GantryPlan};
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
pub struct PaintingLog {
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
    /// Frames of the controller in which it decided, wall-clock ms.
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
    pub best_plan: Option<Box<GantryPlan>>,
    /// Since when the markers are lost, s, and whether the valve was last commanded to be open.
    lost_since: Option<f64>,
    valve_open: bool,
}

impl PaintingLog {
    /// Before anything has happened to a bare object.
    pub(super) fn new(bare: Coverage) -> Self {
        Self {
            ticks: Vec::new(),
            messages: Vec::new(),
            truth: bare.clone(),
            belief: bare,
            emitted: 0.0,
            decision_ms: Vec::new(),
            idle_decisions: 0,
            held_decisions: 0,
            lost_ticks: 0,
            pose_jumps: 0,
            shut_after_loss: 0.0,
            limit_hits: 0,
            valve_switches: 0,
            registration_error: 0.0,
            position_error_rms: 0.0,
            best_plan: None,
            lost_since: None,
            valve_open: false,
        }
    }

    /// What the controller made of a frame, and how long it took for it.
    pub(super) fn note(&mut self, frame: &Frame, command: Command, took: Duration) {
        if frame.world_from_robot.is_none() {
            self.lost_ticks += 1;
            let since = *self.lost_since.get_or_insert(frame.time);
            if self.valve_open && !command.valve_open {
                self.shut_after_loss = self.shut_after_loss.max(frame.time - since);
            }
        } else {
            self.lost_since = None;
        }
        self.valve_open = command.valve_open;
        for event in command.events {
            let message = match event {
                Event::TrackingLost => "markers lost: valve shut, path held".into(),
                Event::TrackingFound { after } => format!("markers found after {after:.2} s"),
                Event::PoseJumped => {
                    self.pose_jumps += 1;
                    "the measured pose jumped: the filter starts anew".into()
                }
                Event::Held => {
                    self.held_decisions += 1;
                    continue;
                }
                Event::Decided(plan) => {
                    self.decision_ms.push(1e3 * took.as_secs_f64());
                    self.idle_decisions += usize::from(plan.score <= 0.0);
                    if self.best_plan.as_ref().is_none_or(|best| plan.score > best.score) {
                        self.best_plan = Some(plan);
                    }
                    continue;
                }
            };
            self.messages.push((frame.time, message));
        }
    }

    /// Time from one moment of the log to the next, s.
    pub fn tick(&self) -> f64 {
        self.ticks.get(1).map_or(0.0, |second| second.time - self.ticks[0].time)
    }

    /// Length of the painting, s.
    pub fn duration(&self) -> f64 {
        self.tick() * self.ticks.len() as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use paint_planner::gantry::SlideSetpoint;
    use paint_sim::droplets::{TexelFace, TexelSurface};

    #[test]
    fn what_happens_is_counted() {
        let corners = [[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.1, 0.0]];
        let texels = Some([[0.0, 1.0], [1.0, 1.0], [0.0, 0.0]]);
        let surface = TexelSurface::new(&[TexelFace { corners, texels }], [1, 1], &[0.005]).unwrap();
        let mut log = PaintingLog::new(Coverage::new(&surface, &[1e-5]).unwrap());
        let slide = SlideSetpoint { position: 0.0, velocity: 0.0 };
        let mut note = |time: f64, tracked: bool, valve_open: bool, events: Vec<Event>| {
            let world_from_robot = tracked.then(Isometry3::identity);
            let frame = Frame { time, world_from_robot, inertial: None, ranges: &[], position: 0.0, sprayed: 0.0 };
            log.note(&frame, Command { valve_open, slide, events }, Duration::from_millis(2));
        };
        note(0.00, true, true, vec![]);
        note(0.01, false, true, vec![Event::TrackingLost]);
        note(0.02, false, false, vec![Event::Held, Event::Held]);
        note(0.03, true, false, vec![Event::TrackingFound { after: 0.02 }, Event::PoseJumped]);
        note(0.04, true, false, vec![Event::PoseJumped]);
        assert_eq!((log.lost_ticks, log.held_decisions, log.pose_jumps), (2, 2, 2));
        assert!((log.shut_after_loss - 0.01).abs() < 1e-12);
        let times: Vec<f64> = log.messages.iter().map(|message| message.0).collect();
        assert_eq!(times, [0.01, 0.03, 0.03, 0.04]);
    }
}
