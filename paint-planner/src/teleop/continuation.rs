//! A segment that begins in motion: the end of the plan in flight is replaced by one that goes on (ours: the letter halts).

use crate::angle::nearest_equivalent;
use crate::clearance::ClearanceChecker;
use crate::error::Error;
use crate::not_served::NotServed;
use crate::nozzle::Nozzles;
use crate::plan::{OptimalPlanner, Plan, Planner, UntimedPlan, assemble_plan};
use crate::route::RoutePoint;
use crate::settings::Settings;
use crate::target::{NozzleState, Target};
use crate::transit::between;
use crate::world::{Surface, Tool, VehicleState};
use nalgebra::UnitVector3;

/// A hit this near to the end of the flying plan is that end, m.
const SAME: f64 = 1e-3;
/// The least number of targets that the vehicle has still before it: the way on which the two plans are blended.
const LEAST_REMAINING: usize = 5;

/// A plan that takes over in flight.
#[derive(Debug, Clone, PartialEq)]
pub struct Continuation {
    /// When it takes over, s on the clock of the plan that it replaces; its own clock begins there.
    pub at: f64,
    /// Its targets: those that were left, then the new ones.
    pub targets: Vec<Target>,
    /// How many of them were left.
    pub remaining: usize,
    /// The plan. It begins with the position, velocity, acceleration and jerk of the replaced one at `at`, and ends at rest.
    pub plan: Plan,
}

/// Lets `flying`, which serves `targets`, go on with the targets `next` instead of halting. The hand-over is at its first target at or
/// after `earliest` (s on its clock). What is left of it is planned anew with the new targets; its vehicle states change over from those
/// of the old plan to those of the new one on the way, so that nothing jumps. All limits and clearances hold as for any plan. Until the
/// hand-over nothing changes, and the old plan, which ends at rest, stays valid whatever happens.
///
/// # Errors
/// [`Error::Continuation`] where too little is left, a target cannot be served, a halt would be needed, or limits or clearance cannot
/// be kept from the speed that the vehicle has: let it halt, and plan from there.
pub fn continue_plan(
    flying: &Plan,
    targets: &[Target],
    earliest: f64,
    next: &[Target],
    surface: &dyn Surface,
    tool: &dyn Tool,
    settings: &Settings,
) -> Result<Continuation, Error> {
    let refuse = |what| Err(Error::Continuation { what });
    let first = flying.target_time.partition_point(|time| *time < earliest);
    let served = flying.report.served == targets.len() && targets.len() == flying.target_time.len();
    if !served || first + LEAST_REMAINING > targets.len() {
        return refuse("too little of the plan in flight is left");
    }
    let at = flying.target_time[first];
    let mut left = targets[first..].to_vec();
    // The end that the next segment begins with is the same place.
    if let (Some(last), Some(begin)) = (left.last(), next.first())
        && (begin.point - last.point).norm() < SAME
    {
        left.pop();
    }
    let remaining = left.len();
    let all: Vec<Target> = left.into_iter().chain(next.iter().copied()).collect();
    let anew = OptimalPlanner::default().plan(
        &all,
        surface,
        tool,
        &Settings { start: None, goal: None, ..settings.clone() },
    )?;
    if anew.report.served < all.len() || anew.waypoints.iter().any(|waypoint| waypoint.target.is_none()) {
        return refuse("a target cannot be served on the way");
    }
    let (states, nozzles) = blended(flying, first, remaining, &anew, at);
    let route = states.iter().enumerate().map(|(k, state)| RoutePoint { state: *state, target: Some(k), rest: false });
    let untimed = UntimedPlan {
        nozzles: Nozzles {
            states: nozzles,
            rounds: anew.report.rounds,
            steps: anew.report.steps,
            slack: anew.report.slack,
        },
        vehicle: states.iter().copied().map(Ok).collect(),
        heading_cost: anew.report.heading_cost,
        route: route.collect(),
        start: flying.trajectory.motion(at),
    };
    let mut checker = ClearanceChecker::new(surface, tool);
    for dense in [false, true] {
        let Ok((plan, violations)) = assemble_plan(&untimed, &all, &mut checker, settings, dense) else { continue };
        checker.check_answers()?;
        if violations.is_empty() {
            return Ok(Continuation { at, targets: all, remaining, plan });
        }
    }
    refuse("limits or clearance cannot be kept from this speed")
}

/// Vehicle and nozzle states of the new plan, which begin as those of the old one and leave them with all slopes zero.
fn blended(
    flying: &Plan,
    first: usize,
    remaining: usize,
    anew: &Plan,
    at: f64,
) -> (Vec<VehicleState>, Vec<Result<NozzleState, NotServed>>) {
    let here = flying.trajectory.sample(at);
    let mut states = anew.vehicle.clone();
    let mut nozzles: Vec<NozzleState> = anew.nozzle.clone();
    let mut heading = here.heading;
    for k in 0..states.len() {
        if k < remaining {
            let s = k as f64 / remaining as f64;
            let new = s * s * (3.0 - 2.0 * s);
            states[k] = between(&flying.vehicle[first + k], &states[k], new);
            nozzles[k] = mixed(&flying.nozzle[first + k], &nozzles[k], new);
        }
        states[k].heading = nearest_equivalent(states[k].heading, heading);
        heading = states[k].heading;
    }
    // The trajectory may pass its waypoints at the tolerance, and where it passes is where the new one begins.
    states[0].position = here.position;
    states[0].heading = here.heading;
    (states, nozzles.into_iter().map(Ok).collect())
}

fn mixed(from: &NozzleState, to: &NozzleState, share: f64) -> NozzleState {
    let direction = from.direction.lerp(&to.direction, share);
    NozzleState {
        position: from.position + (to.position - from.position) * share,
        direction: UnitVector3::try_new(direction, 1e-9).unwrap_or(to.direction),
    }
}
