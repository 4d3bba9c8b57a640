//! Rehearsals: a plan is flown in the caller's simulation before it counts, which tells where the vehicle came too near the surface.

use crate::error::Error;
use crate::plan::{Plan, Setpoint};
use crate::world::{Surface, Tool, VehicleState};
use nalgebra::Point3;

/// Time between two looks of a [`MarginRehearsal`], s.
const LOOK: f64 = 0.05;

/// A moment of a rehearsal at which the vehicle comes too near something.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NearMiss {
    /// Time on the plan's trajectory, s.
    pub time: f64,
    /// How much clearance is missing, m.
    pub missing: f64,
}

/// Flies plans, simulated or real, and tells where the vehicle came too near something: in wind, with a controller that lags, with a
/// localisation that errs.
///
/// Closures from a plan to its near misses are rehearsals.
pub trait Rehearsal {
    /// What may go wrong, in flying or in planning.
    type Error: From<Error>;

    /// Flies a plan; moments without a near miss are left out, the order does not matter.
    ///
    /// # Errors
    /// Whatever keeps the plan from being flown. A near miss is no error.
    fn near_misses(&self, plan: &Plan) -> Result<Vec<NearMiss>, Self::Error>;
}

/// Nothing is flown: plans are believed as they are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct NoRehearsal;

impl Rehearsal for NoRehearsal {
    type Error = Error;

    fn near_misses(&self, _: &Plan) -> Result<Vec<NearMiss>, Error> {
        Ok(Vec::new())
    }
}

impl<F: Fn(&Plan) -> Vec<NearMiss>> Rehearsal for F {
    type Error = Error;

    fn near_misses(&self, plan: &Plan) -> Result<Vec<NearMiss>, Error> {
        Ok(self(plan))
    }
}

/// No simulation: a vehicle that strays from its reference by a known bound at most. The planned motion itself keeps `margin` from the
/// surface, between the targets too.
#[derive(Clone, Copy)]
pub struct MarginRehearsal<'a> {
    /// The surface, with whatever else is in the way.
    pub surface: &'a dyn Surface,
    /// The vehicle with its gun.
    pub tool: &'a dyn Tool,
    /// Greatest error of the controller, and what shall be left then, m.
    pub margin: f64,
}

impl Rehearsal for MarginRehearsal<'_> {
    type Error = Error;

    fn near_misses(&self, plan: &Plan) -> Result<Vec<NearMiss>, Error> {
        let mut spheres = Vec::new();
        let mut missing = |(time, s): (f64, Setpoint)| {
            spheres.clear();
            let (position, heading) = (s.sample.position, s.sample.heading);
            self.tool.spheres(&VehicleState { position, heading, pan: s.pan, tilt: s.tilt }, &mut spheres);
            NearMiss { time, missing: self.margin - gap(&spheres, self.surface, self.margin) }
        };
        Ok(plan.setpoints(LOOK).map(&mut missing).filter(|near| near.missing > 0.0).collect())
    }
}

/// Least distance between the spheres (centre in world, radius) of a collision body and a surface, m; at most `below`, negative where
/// they overlap.
pub fn gap(spheres: &[(Point3<f64>, f64)], surface: &dyn Surface, below: f64) -> f64 {
    let gap = |(centre, radius): &(_, f64)| {
        let far = radius + below;
        let distance = surface.distance(centre, far);
        // The difference of a clipped distance may fall below by a rounding, which would be a near miss.
        if distance < far { distance - radius } else { below }
    };
    spheres.iter().map(gap).fold(below, f64::min)
}
