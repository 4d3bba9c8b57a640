//! The route of the vehicle past all targets served, with flights between separate strokes.

use crate::angle::nearest_equivalent;
use crate::clearance::{ClearanceChecker, DistanceCache};
use crate::error::Error;
use crate::settings::Settings;
use crate::world::VehicleState;
use nalgebra::Vector3;

/// Greatest motion between two collision checks of a flight, m and (scaled by one metre) rad.
const CHECK_STEP: f64 = 0.05;
/// Retreats tried, m.
const RETREAT_DISTANCES: [f64; 6] = [0.15, 0.3, 0.6, 1.2, 2.4, 4.8];
/// Climbs tried on top of a retreat, m.
const CLIMB_HEIGHTS: [f64; 7] = [0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0];

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
    vehicle: &mut [Option<VehicleState>],
    joined: &[bool],
    mut checker: Option<&mut ClearanceChecker<'_>>,
    clearance: &[f64],
    settings: &Settings,
) -> Result<Vec<RoutePoint>, Error> {
    let mut route: Vec<RoutePoint> = Vec::with_capacity(vehicle.len());
    let mut name = String::from("the start pose");
    let mut refused = None;
    if let Some(state) = settings.start {
        route.push(RoutePoint { state, target: None, rest: true });
    }
    // Whether the state before belongs to a stroke on the route, and whether it belongs to one that was dropped.
    let (mut on_route, mut dropping) = (false, false);
    for i in 0..vehicle.len() {
        let follows = i > 0 && joined[i - 1];
        let Some(state) = vehicle[i] else {
            (on_route, dropping) = (false, false);
            continue;
        };
        let mut rest = false;
        dropping &= follows;
        if let Some(last) = route.last().copied().filter(|_| !(dropping || on_route && follows)) {
            let to = format!("target {i}");
            let both = last.target.map_or(clearance[i], |before| clearance[before].min(clearance[i]));
            let keep = both.max(settings.clearance);
            match add_transit(&mut route, &last.state, &state, checker.as_deref_mut(), keep, settings, (&name, &to)) {
                Ok(halts) => rest = halts,
                Err(error) => (refused, dropping) = (Some(error), true),
            }
        }
        on_route = !dropping;
        if dropping {
            vehicle[i] = None;
            continue;
        }
        push(&mut route, state, Some(i), rest);
        name = format!("target {i}");
    }
    if let Some(error) = refused.filter(|_| route.iter().all(|point| point.target.is_none())) {
        return Err(error);
    }
    if let (Some(state), Some(last)) = (settings.goal, route.last().copied()) {
        add_transit(&mut route, &last.state, &state, checker, settings.clearance, settings, (&name, "the goal pose"))?;
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

/// Adds the route points between two states: straight if that is clear, else back off from the surface on both sides, else
/// climb over it as well. Detours halt at their corners, so that the trajectory between them is the checked line; returns
/// whether the arrival has to halt too.
fn add_transit(
    route: &mut Vec<RoutePoint>,
    from: &VehicleState,
    to: &VehicleState,
    checker: Option<&mut ClearanceChecker<'_>>,
    clearance: f64,
    settings: &Settings,
    names: (&str, &str),
) -> Result<bool, Error> {
    let Some(checker) = checker else {
        add_straight(route, from, to, settings.timing.knot_spacing);
        return Ok(false);
    };
    if legs_are_clear(checker, &[*from, *to], clearance) {
        add_straight(route, from, to, settings.timing.knot_spacing);
        return Ok(false);
    }
    // Backwards from the surface: against the spray; or against the heading, along which the body came in.
    let retreats: [fn(&VehicleState) -> Vector3<f64>; 2] = [VehicleState::spray_azimuth, VehicleState::forward];
    let back = |state: &VehicleState, forward: fn(&VehicleState) -> Vector3<f64>, distance: f64| VehicleState {
        position: state.position - forward(state) * distance,
        ..*state
    };
    for retreat in RETREAT_DISTANCES {
        for forward in retreats {
            let corners = [*from, back(from, forward, retreat), back(to, forward, retreat), *to];
            if legs_are_clear(checker, &corners, clearance) {
                add_detour(route, &corners);
                return Ok(true);
            }
        }
    }
    let top = from.position.z.max(to.position.z);
    for retreat in RETREAT_DISTANCES {
        for climb in CLIMB_HEIGHTS {
            for forward in retreats {
                let over = |state: &VehicleState| {
                    let mut high = back(state, forward, retreat);
                    high.position.z = top + climb;
                    high
                };
                let (out, home) = (back(from, forward, retreat), back(to, forward, retreat));
                let corners = [*from, out, over(from), over(to), home, *to];
                if legs_are_clear(checker, &corners, clearance) {
                    add_detour(route, &corners);
                    return Ok(true);
                }
            }
        }
    }
    Err(Error::NoTransit { from: names.0.to_owned(), to: names.1.to_owned() })
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

/// State between two, every coordinate linear, the heading by the shorter way.
pub(crate) fn between(from: &VehicleState, to: &VehicleState, share: f64) -> VehicleState {
    let mix = |a: f64, b: f64| a + (b - a) * share;
    VehicleState {
        position: from.position + (to.position - from.position) * share,
        heading: mix(from.heading, nearest_equivalent(to.heading, from.heading)),
        pan: mix(from.pan, to.pan),
        tilt: mix(from.tilt, to.tilt),
    }
}

/// Whether the body keeps clear along the straight legs between the corners.
fn legs_are_clear(checker: &mut ClearanceChecker<'_>, corners: &[VehicleState], clearance: f64) -> bool {
    let mut cache = DistanceCache::default();
    corners.windows(2).all(|leg| {
        let turn = nearest_equivalent(leg[1].heading, leg[0].heading) - leg[0].heading;
        let joints = Vector3::new(turn, leg[1].pan - leg[0].pan, leg[1].tilt - leg[0].tilt);
        let motion = (leg[1].position - leg[0].position).norm() + joints.abs().sum();
        let steps = (motion / CHECK_STEP).ceil().clamp(1.0, 1e5) as usize;
        (0..=steps)
            .all(|k| checker.is_clear(&between(&leg[0], &leg[1], k as f64 / steps as f64), clearance, &mut cache))
    })
}
