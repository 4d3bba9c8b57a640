//! What a planner returns.

use crate::not_served::NotServed;
use crate::settings::TimingSettings;
use crate::target::{NozzleState, Target};
use crate::trajectory::{Extrema, Sample, Trajectory};
use crate::transit::between;
use crate::world::VehicleState;
use nalgebra::{Point3, UnitVector3};

/// A place the vehicle passes at a time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Waypoint {
    /// Time on the trajectory, s.
    pub time: f64,
    /// Planned state; its heading is continuous along the plan.
    pub state: VehicleState,
    /// Index of the target served here, or of the last one where the joints turn unevenly to the next; `None` on flights between strokes.
    pub target: Option<usize>,
}

/// Figures of a plan.
#[derive(Debug, Clone, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PlanReport {
    /// Normal deviation of every target's nozzle state, m; 0 where the target is not served.
    pub normal_deviation: Vec<f64>,
    /// Its mean over the targets served, m.
    pub normal_deviation_mean: f64,
    /// Its maximum over the targets served, m.
    pub normal_deviation_max: f64,
    /// Targets served.
    pub served: usize,
    /// Greatest relaxation of a soft spray-cone row in stage 1 (tangent of an angle).
    pub slack: f64,
    /// Rounds or Jacobi iterations of stage 1.
    pub rounds: usize,
    /// Steps of the solver in stage 1, all rounds together.
    pub steps: usize,
    /// Optimal cost of the heading search.
    pub heading_cost: f64,
    /// Certified extrema of the trajectory.
    pub extrema: Extrema,
    /// Greatest rate of pan or tilt, rad/s; exact, as planned joints are linear in time between waypoints.
    pub joint_rate: f64,
    /// Factor by which all times were stretched in the end to meet the limits; with gradient-preserving timing the
    /// factor k of thesis section 7.5, else 1.
    pub stretch: f64,
    /// Time of the fastest law along the same path within the same limits, s: the acceleration may jump (TOPP-RA on pieces of 12.5 ms).
    pub time_bound: f64,
    /// Greatest distance between the trajectory and a waypoint at its time, m.
    pub path_deviation: f64,
    /// Least distance between collision body and surface seen along the trajectory, m, clipped at 1; negative: overlap.
    pub clearance: f64,
    /// How much of the clearance asked for may be missing somewhere along the trajectory, m; 0 certifies that none is.
    pub clearance_missing: f64,
}

/// A plan for a whole path. Vectors are indexed by target.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// Nozzle states, m, world frame; for targets not served the ideal state of VR paper, Eq. (1).
    pub nozzle: Vec<NozzleState>,
    /// Vehicle states; for targets not served the state of the served target before (else after).
    pub vehicle: Vec<VehicleState>,
    /// Which targets are served.
    pub reachable: Vec<bool>,
    /// Why the others are not; [`NotServed::Missed`]: passed, but with the valve shut to the next one.
    pub not_served: Vec<Option<NotServed>>,
    /// When each target is passed, s; for targets not served a time between their neighbours'.
    pub target_time: Vec<f64>,
    /// Flow from each target to the next, m^3/s; 0 for the last, on flights, and next to targets not served.
    pub flow: Vec<f64>,
    /// The vehicle's trajectory.
    pub trajectory: Trajectory,
    /// Its waypoints in order of time.
    pub waypoints: Vec<Waypoint>,
    /// Figures.
    pub report: PlanReport,
    pub(crate) points: Vec<Point3<f64>>,
}

/// Everything the controllers need at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Setpoint {
    /// Vehicle reference.
    pub sample: Sample,
    /// Point on the surface to aim at, m.
    pub aim: Point3<f64>,
    /// Planned nozzle, between the targets before and after.
    pub nozzle: NozzleState,
    /// Planned pan, rad.
    pub pan: f64,
    /// Planned tilt, rad.
    pub tilt: f64,
    /// Flow of paint, m^3/s.
    pub flow: f64,
    /// On a flight between strokes: hold `pan` and `tilt` instead of aiming; the collision check counted on that.
    pub transit: bool,
}

impl Plan {
    /// The references at time `t`, clamped to the duration of the trajectory.
    pub fn setpoint(&self, t: f64) -> Setpoint {
        let t = if t.is_finite() { t.clamp(0.0, self.trajectory.duration()) } else { 0.0 };
        let last = self.waypoints.len() - 1;
        let i = self.waypoints.partition_point(|w| w.time <= t).clamp(1, last) - 1;
        let (a, b) = (&self.waypoints[i], &self.waypoints[i + 1]);
        let state = between(&a.state, &b.state, share(a.time, b.time, t));
        let [before, after] = self.targets_about(i);
        // A plan serves at least one target, so one of the two exists.
        let (from, to) = (before.or(after).unwrap_or(0), after.or(before).unwrap_or(0));
        let ratio = share(self.target_time[from], self.target_time[to], t);
        let (p, q) = (&self.nozzle[from], &self.nozzle[to]);
        let mixed = p.direction.lerp(&q.direction, ratio);
        let direction = UnitVector3::try_new(mixed, 1e-9).unwrap_or(p.direction);
        let stroke = matches!((a.target, b.target), (Some(x), Some(y)) if y == x || y == x + 1);
        Setpoint {
            sample: self.trajectory.sample(t),
            aim: self.points[from] + (self.points[to] - self.points[from]) * ratio,
            nozzle: NozzleState { position: p.position + (q.position - p.position) * ratio, direction },
            pan: state.pan,
            tilt: state.tilt,
            flow: if stroke { self.flow[from] } else { 0.0 },
            transit: !stroke,
        }
    }

    /// The last target at or before a waypoint, and the first one after it.
    pub(crate) fn targets_about(&self, waypoint: usize) -> [Option<usize>; 2] {
        let (before, after) = self.waypoints.split_at(waypoint + 1);
        let last = before.iter().rev().find_map(|w| w.target);
        [last, after.iter().find_map(|w| w.target.filter(|target| Some(*target) != last))]
    }

    /// Paint the plan puts between target `i` and the next, m^3.
    pub fn volume(&self, i: usize) -> f64 {
        match self.target_time.get(i + 1) {
            Some(next) => self.flow[i] * (next - self.target_time[i]),
            None => 0.0,
        }
    }

    /// References every `step` seconds, each with its time.
    pub fn setpoints(&self, step: f64) -> impl Iterator<Item = (f64, Setpoint)> {
        let steps = (self.trajectory.duration() / step) as usize;
        (0..=steps).map(move |k| (k as f64 * step, self.setpoint(k as f64 * step)))
    }

    /// Length of the vehicle's trajectory, m, by chords of 50 ms.
    pub fn path_length(&self) -> f64 {
        let steps = (self.trajectory.duration() / 0.05).ceil().max(1.0);
        let at = |k: f64| self.trajectory.sample(self.trajectory.duration() * k / steps).position;
        (0..steps as usize).map(|k| (at(k as f64 + 1.0) - at(k as f64)).norm()).sum()
    }

    /// Time with the valve open, s.
    pub fn open_time(&self) -> f64 {
        let open = self.target_time.windows(2).zip(&self.flow).filter(|(_, flow)| **flow > 0.0);
        open.map(|(times, _)| times[1] - times[0]).sum()
    }

    /// Moments, every `step` seconds, at which speed, acceleration, heading rate or joint rate exceed a limit: a check beside the
    /// certificates of the report, which do not depend on sampling.
    pub fn limit_violations(&self, limits: &TimingSettings, step: f64) -> usize {
        let slack = 1.0 + 1e-9;
        let exceeds = |k: &usize| {
            let [here, next] = [*k, k + 1].map(|k| self.setpoint(k as f64 * step));
            let (s, joints) = (&here.sample, (next.pan - here.pan).abs().max((next.tilt - here.tilt).abs()));
            s.velocity.norm() > limits.max_speed * slack
                || s.acceleration.norm() > limits.max_acceleration * slack
                || s.heading_rate.abs() > limits.max_heading_rate * slack
                || joints > step * limits.max_joint_rate * slack
        };
        (0..=(self.trajectory.duration() / step) as usize).filter(exceeds).count()
    }

    pub(crate) fn points_of(targets: &[Target]) -> Vec<Point3<f64>> {
        targets.iter().map(|t| t.point).collect()
    }
}

fn share(from: f64, to: f64, t: f64) -> f64 {
    if to > from { ((t - from) / (to - from)).clamp(0.0, 1.0) } else { 0.0 }
}
