//! Distance between a moving collision body and the surface, with as few queries as the triangle inequality permits.

use crate::error::Error;
use crate::target::NozzleState;
use crate::world::{Surface, Tool, VehicleState};
use nalgebra::Point3;

/// How far distances are resolved, m: spheres farther off than this need no query for a long way.
const QUERY_MARGIN: f64 = 1.0;

/// What was known about one sphere at the last query.
#[derive(Debug, Clone, Copy)]
struct CachedDistance {
    centre: Point3<f64>,
    distance: f64,
}

/// The last queries of every sphere of one body; a body moving along a path asks the surface only when the motion since
/// has used up the slack.
#[derive(Debug, Clone, Default)]
pub(crate) struct DistanceCache {
    spheres: Vec<CachedDistance>,
}

/// Collision checks of one tool against one surface. What a caller's surface or tool answers is checked here: the first answer
/// that cannot be is kept, and told by [`check_answers`](Self::check_answers).
pub(crate) struct ClearanceChecker<'a> {
    surface: &'a dyn Surface,
    tool: &'a dyn Tool,
    spheres: Vec<(Point3<f64>, f64)>,
    fault: Option<Error>,
}

impl<'a> ClearanceChecker<'a> {
    pub(crate) fn new(surface: &'a dyn Surface, tool: &'a dyn Tool) -> Self {
        Self { surface, tool, spheres: Vec::new(), fault: None }
    }

    /// The tool's answer for a nozzle state and a heading.
    pub(crate) fn vehicle(&mut self, nozzle: &NozzleState, heading: f64) -> Option<VehicleState> {
        let vehicle = self.tool.vehicle(nozzle, heading)?;
        let [x, y, z] = vehicle.position.into();
        if [x, y, z, vehicle.heading, vehicle.pan, vehicle.tilt].iter().all(|v| v.is_finite()) {
            return Some(vehicle);
        }
        let at = nozzle.position.into();
        self.fault.get_or_insert(Error::World { what: "the tool's vehicle state has numbers that are not finite", at });
        None
    }

    /// Fails if the surface or the tool has answered what cannot be.
    pub(crate) fn check_answers(&self) -> Result<(), Error> {
        self.fault.clone().map_or(Ok(()), Err)
    }

    /// Whether the tool permits a state, collisions aside.
    pub(crate) fn permits(&self, state: &VehicleState) -> bool {
        self.tool.permits(state)
    }

    /// Radius of a ball about the body's origin that holds the vehicle in all of some states, m.
    pub(crate) fn radius(&mut self, states: impl Iterator<Item = VehicleState>) -> f64 {
        states.fold(0.0, |most, state| {
            self.spheres.clear();
            self.tool.spheres(&state, &mut self.spheres);
            self.spheres.iter().map(|(centre, radius)| (centre - state.position).norm() + radius).fold(most, f64::max)
        })
    }

    /// Distance from a point to the surface, clipped at `max`, m. What is no distance counts as a touch.
    pub(crate) fn distance(&mut self, centre: &Point3<f64>, max: f64) -> f64 {
        let distance = self.surface.distance(centre, max);
        if distance >= 0.0 {
            return distance;
        }
        let what = "the distance to the surface is negative or not a number";
        self.fault.get_or_insert(Error::World { what, at: (*centre).into() });
        0.0
    }

    /// Whether the tool permits the state and every sphere keeps `clearance` from the surface.
    pub(crate) fn is_clear(&mut self, state: &VehicleState, clearance: f64, cache: &mut DistanceCache) -> bool {
        if !self.tool.permits(state) {
            return false;
        }
        self.spheres.clear();
        self.tool.spheres(state, &mut self.spheres);
        for k in 0..self.spheres.len() {
            let (centre, radius) = self.spheres[k];
            let need = radius + clearance;
            match cache.spheres.get(k) {
                Some(last) if last.distance - (centre - last.centre).norm() >= need => continue,
                Some(last) if last.distance + (centre - last.centre).norm() < need => return false,
                _ => {}
            }
            let distance = self.distance(&centre, need + QUERY_MARGIN);
            let fresh = CachedDistance { centre, distance };
            if k < cache.spheres.len() {
                cache.spheres[k] = fresh;
            } else if k == cache.spheres.len() {
                cache.spheres.push(fresh);
            }
            if distance < need {
                return false;
            }
        }
        true
    }

    /// Smallest distance between a sphere and the surface, negative where they overlap, clipped at `below`, m.
    pub(crate) fn clearance(&mut self, state: &VehicleState, below: f64, cache: &mut DistanceCache) -> f64 {
        self.spheres.clear();
        self.tool.spheres(state, &mut self.spheres);
        let mut least = below;
        for k in 0..self.spheres.len() {
            let (centre, radius) = self.spheres[k];
            if cache.spheres.get(k).is_some_and(|last| last.distance - (centre - last.centre).norm() - radius >= least)
            {
                continue;
            }
            let distance = self.distance(&centre, radius + below.max(0.0) + QUERY_MARGIN);
            let fresh = CachedDistance { centre, distance };
            if k < cache.spheres.len() {
                cache.spheres[k] = fresh;
            } else if k == cache.spheres.len() {
                cache.spheres.push(fresh);
            }
            least = least.min(distance - radius);
        }
        least
    }
}
