//! When a plan sprays: only where the planned spray meets its aim.

use super::solution::Waypoint;
use crate::clearance::ClearanceChecker;
use crate::route::RoutePoint;
use crate::settings::Settings;
use crate::target::Target;
use crate::timing::TimedTrajectory;
use crate::timing::speed_profile::{joint_motion, stroke_between};
use nalgebra::Point3;

/// Greatest distance between two looks at the aim on the surface, m.
const AIM_STEP: f64 = 0.005;
/// Part of the tolerance that looks are held to: between two of them the aim is farther off.
const AIM_MARGIN: f64 = 0.9;

/// What is sprayed along a route.
pub(super) struct Valve {
    /// The points of the route, and more between them where the joints have to turn unevenly to keep to the aim.
    pub(super) waypoints: Vec<Waypoint>,
    /// Flow from each target to the next, m^3/s.
    pub(super) flow: Vec<f64>,
    /// Targets after which the valve stays shut because the planned motion misses its aim.
    pub(super) missed: Vec<usize>,
}

pub(super) fn valve(
    route: &[RoutePoint],
    timed: &TimedTrajectory,
    targets: &[Target],
    checker: &ClearanceChecker<'_>,
    settings: &Settings,
) -> Valve {
    let waypoint = |(point, &time): (&RoutePoint, &f64)| Waypoint { time, state: point.state, target: point.target };
    let passed: Vec<Waypoint> = route.iter().zip(&timed.times).map(waypoint).collect();
    let mut valve =
        Valve { waypoints: Vec::with_capacity(passed.len()), flow: vec![0.0; targets.len()], missed: vec![] };
    for (points, pair) in route.windows(2).zip(passed.windows(2)) {
        valve.waypoints.push(pair[0]);
        let (length, dose) = stroke_between(points, targets);
        let Some(target) = pair[0].target.filter(|_| length > 0.0 && dose > 0.0) else { continue };
        let edge =
            Edge { ends: [pair[0], pair[1]], timed, aims: [targets[target], targets[target + 1]], checker, settings };
        if let Some(between) = edge.on_aim() {
            // Dose times spot speed: the volume on the stroke does not depend on the timing.
            valve.flow[target] = dose * length / (pair[1].time - pair[0].time);
            valve.waypoints.extend(between);
        } else {
            valve.missed.push(target);
        }
    }
    valve.waypoints.extend(passed.last());
    valve
}

/// The way from one target to the next.
struct Edge<'a> {
    ends: [Waypoint; 2],
    timed: &'a TimedTrajectory,
    aims: [Target; 2],
    checker: &'a ClearanceChecker<'a>,
    settings: &'a Settings,
}

impl Edge<'_> {
    /// The waypoints between the ends with which the spray meets its aim all the way; none if even joints do, `None` if nothing helps.
    fn on_aim(&self) -> Option<Vec<Waypoint>> {
        let [from, to] = self.ends;
        if self.keeps_to_aim(&[from, to]) {
            return Some(Vec::new());
        }
        let pieces = self.looks();
        let between = (1..pieces).map(|k| self.aimed(k as f64 / pieces as f64)).collect::<Option<Vec<_>>>()?;
        let all: Vec<Waypoint> = std::iter::once(from).chain(between.iter().copied()).chain([to]).collect();
        let most = self.settings.timing.max_joint_rate;
        let slow =
            |pair: &[Waypoint]| joint_motion(&pair[0].state, &pair[1].state) <= most * (pair[1].time - pair[0].time);
        (all.windows(2).all(slow) && self.keeps_to_aim(&all)).then_some(between)
    }

    /// Parts in which the aim is looked at.
    fn looks(&self) -> usize {
        ((self.aims[1].point - self.aims[0].point).norm() / AIM_STEP).ceil().clamp(2.0, 1e4) as usize
    }

    /// Looks twice between two waypoints where there are many.
    fn keeps_to_aim(&self, waypoints: &[Waypoint]) -> bool {
        let looks = (self.looks() / (waypoints.len() - 1)).max(2);
        waypoints.windows(2).all(|pair| {
            (0..=looks).all(|k| {
                let share = k as f64 / looks as f64;
                let times = [pair[0].time, pair[1].time];
                let state = self.timed.state(&pair[0].state, &pair[1].state, times, share);
                let aim = self.aim(times[0] + (times[1] - times[0]) * share);
                self.checker.miss(&state, &aim).is_none_or(|miss| miss <= AIM_MARGIN * self.settings.valve_tolerance)
            })
        })
    }

    /// Where the spray is wanted at a time.
    fn aim(&self, time: f64) -> Point3<f64> {
        let share = (time - self.ends[0].time) / (self.ends[1].time - self.ends[0].time);
        self.aims[0].point + (self.aims[1].point - self.aims[0].point) * share
    }

    /// The vehicle on the way, its joints turned to the aim.
    fn aimed(&self, share: f64) -> Option<Waypoint> {
        let [from, to] = self.ends;
        let time = from.time + (to.time - from.time) * share;
        let even = self.timed.state(&from.state, &to.state, [from.time, to.time], share);
        self.checker.aimed(&even, &self.aim(time)).map(|state| Waypoint { time, state, target: from.target })
    }
}
