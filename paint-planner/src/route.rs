//! The route of the vehicle past all targets served, with flights between separate strokes.

use crate::angle::nearest_equivalent;
use crate::clearance::ClearanceChecker;
use crate::error::Error;
use crate::not_served::NotServed;
use crate::settings::Settings;
use crate::transit::{TransitPlanner, between};
use crate::world::VehicleState;

/// A place the vehicle passes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct RoutePoint {
    /// Its heading is continuous along the route.
    pub(crate) state: VehicleState,
    /// The target served here.
    pub(crate) target: Option<usize>,
    /// The vehicle halts here.
    pub(crate) rest: bool,
}

/// Chains the vehicle states of all targets. `joined[i]`: states i and i+1 follow each other without a flight. A flight keeps
/// the clearance that both of its ends keep; with no checker the flights are straight and unchecked.
///
/// A stroke that no flight leads to is dropped from `vehicle`; an error means that none is left, or that the goal pose
/// cannot be reached.
pub(crate) fn build(
    vehicle: &mut [Result<VehicleState, NotServed>],
    joined: &[bool],
    mut checker: Option<&mut ClearanceChecker<'_>>,
    clearance: &[f64],
    settings: &Settings,
) -> Result<Vec<RoutePoint>, Error> {
    let mut route: Vec<RoutePoint> = Vec::with_capacity(vehicle.len());
    let mut name = String::from("the start pose");
    let (mut refused, mut planner) = (None, None);
    if let Some(state) = settings.start {
        route.push(RoutePoint { state, target: None, rest: true });
    }
    // Whether the state before belongs to a stroke on the route, and whether it belongs to one that was dropped.
    let (mut on_route, mut dropping) = (false, false);
    for i in 0..vehicle.len() {
        let follows = i > 0 && joined[i - 1];
        let Ok(state) = vehicle[i] else {
            (on_route, dropping) = (false, false);
            continue;
        };
        let mut rest = false;
        dropping &= follows;
        if let Some(last) = route.last().copied().filter(|_| !(dropping || on_route && follows)) {
            let both = last.target.map_or(clearance[i], |before| clearance[before].min(clearance[i]));
            let keep = both.max(settings.clearance);
            let ends = [&last.state, &state];
            let transits = planner.get_or_insert_with(|| TransitPlanner::new(&last.state));
            if let Some(halts) = add_transit(&mut route, ends, checker.as_deref_mut(), transits, keep, settings) {
                rest = halts;
            } else {
                refused = Some(Error::NoTransit { from: name.clone(), to: format!("target {i}") });
                dropping = true;
            }
        }
        on_route = !dropping;
        if dropping {
            vehicle[i] = Err(NotServed::NoTransit);
            continue;
        }
        push(&mut route, state, Some(i), rest);
        name = format!("target {i}");
    }
    if let Some(error) = refused.filter(|_| route.iter().all(|point| point.target.is_none())) {
        return Err(error);
    }
    if let (Some(state), Some(last)) = (settings.goal, route.last().copied()) {
        let ends = [&last.state, &state];
        let transits = planner.get_or_insert_with(|| TransitPlanner::new(&last.state));
        add_transit(&mut route, ends, checker, transits, settings.clearance, settings)
            .ok_or_else(|| Error::NoTransit { from: name, to: String::from("the goal pose") })?;
        push(&mut route, state, None, true);
    }
    Ok(route)
}

fn push(route: &mut Vec<RoutePoint>, mut state: VehicleState, target: Option<usize>, rest: bool) {
    if let Some(last) = route.last() {
        state.heading = nearest_equivalent(state.heading, last.state.heading);
    }
    route.push(RoutePoint { state, target, rest });
}

/// Adds the route points between two states, at one of which a flight starts. Detours halt at their corners, so that the trajectory
/// between them is the checked line; returns whether the arrival has to halt too. With no checker flights are straight.
fn add_transit(
    route: &mut Vec<RoutePoint>,
    [from, to]: [&VehicleState; 2],
    checker: Option<&mut ClearanceChecker<'_>>,
    planner: &mut TransitPlanner,
    clearance: f64,
    settings: &Settings,
) -> Option<bool> {
    let corners = match checker {
        Some(checker) => planner.corners(from, to, checker, clearance)?,
        None => vec![*from, *to],
    };
    let straight = corners.len() == 2;
    if straight {
        add_straight(route, from, to, settings.timing.knot_spacing);
    } else {
        add_detour(route, &corners);
    }
    Some(!straight)
}

/// Intermediate points of a straight flight.
fn add_straight(route: &mut Vec<RoutePoint>, from: &VehicleState, to: &VehicleState, spacing: f64) {
    let pieces = ((to.position - from.position).norm() / spacing).ceil().clamp(1.0, 1e5) as usize;
    for k in 1..pieces {
        push(route, between(from, to, k as f64 / pieces as f64), None, false);
    }
}

/// Halts at the first corner, which is on the route already, and at all between; the caller adds the last.
fn add_detour(route: &mut Vec<RoutePoint>, corners: &[VehicleState]) {
    if let Some(last) = route.last_mut() {
        last.rest = true;
    }
    for corner in &corners[1..corners.len() - 1] {
        push(route, *corner, None, true);
    }
}
