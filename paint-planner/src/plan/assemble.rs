//! From a route to a plan: times, flow, figures.

use super::solution::{Plan, PlanReport, Waypoint};
use super::valve::{Valve, valve};
use crate::clearance::{ClearanceChecker, DistanceCache};
use crate::error::Error;
use crate::minimum_snap::KnotDerivatives;
use crate::not_served::NotServed;
use crate::nozzle::Nozzles;
use crate::route::RoutePoint;
use crate::settings::{Settings, TimingPolicy};
use crate::target::{NozzleState, Target};
use crate::timing::speed_profile::joint_motion;
use crate::timing::{TimedTrajectory, schedule};
use crate::world::VehicleState;

/// Clearances beyond this are not resolved, m.
const MAX_CLEARANCE: f64 = 1.0;

/// A path with its vehicle states, not timed yet.
pub(crate) struct UntimedPlan {
    pub(crate) nozzles: Nozzles,
    /// Of each target, or why it has none.
    pub(crate) vehicle: Vec<Result<VehicleState, NotServed>>,
    pub(crate) heading_cost: f64,
    pub(crate) route: Vec<RoutePoint>,
    /// Motion at the first point of the route; zero: it is left from rest.
    pub(crate) start: KnotDerivatives,
}

/// Where the trajectory may come nearer to the surface than the clearance asked for: between two waypoints.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ClearanceViolation {
    /// Index of the waypoint before.
    pub(super) waypoint: usize,
    /// How much clearance is missing, m.
    pub(super) missing: f64,
}

/// Times the route and gathers the plan, with the places where it comes too near the surface. `dense` binds the trajectory to
/// every waypoint.
pub(crate) fn assemble_plan(
    untimed: &UntimedPlan,
    targets: &[Target],
    checker: &mut ClearanceChecker<'_>,
    settings: &Settings,
    dense: bool,
) -> Result<(Plan, Vec<ClearanceViolation>), Error> {
    check_stamps(targets, &settings.timing.policy)?;
    let mut route = untimed.route.clone();
    if let [only] = route[..] {
        // One state to hold: a trajectory still needs two knots.
        route.push(RoutePoint { target: None, ..only });
    }
    let timed = schedule(&untimed.start, &route, targets, &settings.timing, dense)?;
    let Valve { waypoints, flow, missed } = valve(&route, &timed, targets, checker, settings);
    let mut not_served: Vec<Option<NotServed>> = untimed.vehicle.iter().map(|vehicle| vehicle.err()).collect();
    for target in missed {
        not_served[target] = Some(NotServed::Missed);
    }
    let reachable: Vec<bool> = untimed.vehicle.iter().map(Result::is_ok).collect();
    let ideal = |target: &Target| NozzleState {
        position: target.point + target.normal.into_inner() * target.stand_off_or(settings.nozzle.stand_off),
        direction: -target.normal,
    };
    let nozzle: Vec<NozzleState> = untimed
        .nozzles
        .states
        .iter()
        .zip(targets)
        .map(|(state, target)| state.unwrap_or_else(|_| ideal(target)))
        .collect();
    let (clearance, violations) = least_clearance(&timed, &waypoints, checker, settings.clearance);
    let missing = violations.iter().fold(0.0_f64, |most, violation| most.max(violation.missing));
    let report = report(untimed, targets, &nozzle, &timed, joint_rate(&waypoints), [clearance, missing]);
    let plan = Plan {
        nozzle,
        vehicle: fill(&untimed.vehicle, &waypoints),
        target_time: target_times(targets.len(), &waypoints),
        reachable,
        not_served,
        flow,
        trajectory: timed.trajectory,
        waypoints,
        report,
        points: Plan::points_of(targets),
    };
    Ok((plan, violations))
}

/// Gradient-preserving timing needs increasing time stamps.
fn check_stamps(targets: &[Target], policy: &TimingPolicy) -> Result<(), Error> {
    if *policy != TimingPolicy::GradientPreserving {
        return Ok(());
    }
    for (index, target) in targets.iter().enumerate() {
        let Some(time) = target.time else {
            return Err(Error::Target { index, what: "gradient-preserving timing needs a time stamp" });
        };
        if index > 0 && targets[index - 1].time.is_some_and(|before| before >= time) {
            return Err(Error::Target { index, what: "the time stamp must be later than the one before" });
        }
    }
    Ok(())
}

fn report(
    untimed: &UntimedPlan,
    targets: &[Target],
    nozzle: &[NozzleState],
    timed: &TimedTrajectory,
    joint_rate: f64,
    [clearance, clearance_missing]: [f64; 2],
) -> PlanReport {
    let deviation = |i: usize| match untimed.vehicle[i] {
        Ok(_) => targets[i].normal_deviation(&nozzle[i].position),
        Err(_) => 0.0,
    };
    let normal_deviation: Vec<f64> = (0..targets.len()).map(deviation).collect();
    let served = untimed.vehicle.iter().flatten().count();
    PlanReport {
        normal_deviation_mean: normal_deviation.iter().sum::<f64>() / served as f64,
        normal_deviation_max: normal_deviation.iter().fold(0.0, |most, d| most.max(*d)),
        normal_deviation,
        served,
        slack: untimed.nozzles.slack,
        rounds: untimed.nozzles.rounds,
        steps: untimed.nozzles.steps,
        heading_cost: untimed.heading_cost,
        extrema: timed.extrema,
        joint_rate,
        stretch: timed.stretch,
        time_bound: timed.time_bound,
        path_deviation: timed.deviation,
        clearance,
        clearance_missing,
    }
}

/// Greatest rate of a joint between two waypoints, rad/s.
fn joint_rate(waypoints: &[Waypoint]) -> f64 {
    let rate = |pair: &[Waypoint]| joint_motion(&pair[0].state, &pair[1].state) / (pair[1].time - pair[0].time);
    waypoints.windows(2).map(rate).fold(0.0, f64::max)
}

/// Flies the trajectory with the planned joints and measures the distance to the surface: the least of all, and where it
/// may fall below `wanted`, certified between the looks.
fn least_clearance(
    timed: &TimedTrajectory,
    waypoints: &[Waypoint],
    checker: &mut ClearanceChecker<'_>,
    wanted: f64,
) -> (f64, Vec<ClearanceViolation>) {
    let mut cache = DistanceCache::default();
    let mut least = MAX_CLEARANCE;
    let mut violations = Vec::new();
    for (waypoint, pair) in waypoints.windows(2).enumerate() {
        let (from, to) = (&pair[0].state, &pair[1].state);
        let times = [pair[0].time, pair[1].time];
        // Every point of the body lies within a ball about its origin.
        let lever = checker.radius([*from, *to].into_iter());
        let joints = (to.pan - from.pan).abs() + (to.tilt - from.tilt).abs();
        let most = timed.trajectory.bounds_between(times);
        let motion = (times[1] - times[0]) * (most.speed + lever * most.heading_rate) + lever * joints;
        let state = |share: f64| timed.state(from, to, times, share);
        let (here, missing) = checker.along(&state, motion, wanted, least, &mut cache);
        if missing > 0.0 {
            violations.push(ClearanceViolation { waypoint, missing });
        }
        least = least.min(here);
    }
    (least, violations)
}

/// Vehicle states of targets not served: the one before, at the beginning the one after.
fn fill(vehicle: &[Result<VehicleState, NotServed>], waypoints: &[Waypoint]) -> Vec<VehicleState> {
    let mut last = waypoints.iter().find(|w| w.target.is_some()).unwrap_or(&waypoints[0]).state;
    let mut result: Vec<VehicleState> = Vec::with_capacity(vehicle.len());
    for state in vehicle {
        last = state.unwrap_or(last);
        result.push(last);
    }
    result
}

/// Times of all targets; those not served are spread evenly between their neighbours.
fn target_times(count: usize, waypoints: &[Waypoint]) -> Vec<f64> {
    let served: Vec<(usize, f64)> = waypoints.iter().filter_map(|w| w.target.map(|i| (i, w.time))).collect();
    (0..count)
        .map(|i| {
            let after = served.partition_point(|(index, _)| *index < i);
            match (after.checked_sub(1).map(|k| served[k]), served.get(after)) {
                (_, Some(&(index, time))) if index == i => time,
                (Some((a, s)), Some(&(b, t))) => s + (t - s) * (i - a) as f64 / (b - a) as f64,
                (Some((_, time)), None) | (None, Some(&(_, time))) => time,
                (None, None) => 0.0,
            }
        })
        .collect()
}
