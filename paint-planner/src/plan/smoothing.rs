//! The smoothing planner, the baseline of Paper II, section 6.2: face the wall horizontally, smooth, fly.

use super::assemble::{UntimedPlan, assemble_plan};
use super::solution::Plan;
use super::strategy::Planner;
use crate::clearance::ClearanceChecker;
use crate::error::Error;
use crate::lowess::lowess;
use crate::minimum_snap::KnotDerivatives;
use crate::not_served::NotServed;
use crate::nozzle::Nozzles;
use crate::route;
use crate::settings::Settings;
use crate::target::{NozzleState, Target, check, stroke_links};
use crate::world::{Surface, Tool, VehicleState};
use nalgebra::{Point3, UnitVector3, Vector3};

/// Stands off along the horizontal part of the normal, looks straight at the wall, and smooths position and heading with
/// LOWESS. It ignores tilt, collisions and clearances, as published; [`PlanReport`](super::PlanReport) tells what that costs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct SmoothingPlanner;

impl Planner for SmoothingPlanner {
    fn name(&self) -> &'static str {
        "smoothing"
    }

    fn plan_with_clearance(
        &self,
        targets: &[Target],
        _: &[Option<f64>],
        surface: &dyn Surface,
        tool: &dyn Tool,
        settings: &Settings,
    ) -> Result<Plan, Error> {
        settings.check()?;
        check(targets, settings.nozzle.distances())?;
        let linked = stroke_links(targets, settings.break_length);
        let nozzles = smooth(targets, &linked, settings);
        let mut vehicle: Vec<Result<VehicleState, NotServed>> = nozzles
            .iter()
            .map(|nozzle| {
                let heading = nozzle.direction.y.atan2(nozzle.direction.x);
                tool.vehicle(nozzle, heading).ok_or(NotServed::OutOfReach)
            })
            .collect();
        if vehicle.iter().all(Result::is_err) {
            return Err(Error::NothingReachable { count: targets.len() });
        }
        let route = route::build(&mut vehicle, &linked, None, &vec![settings.clearance; targets.len()], settings)?;
        let states = nozzles.into_iter().zip(&vehicle).map(|(n, v)| v.map(|_| n)).collect();
        let nozzles = Nozzles { states, rounds: 0, steps: 0, slack: 0.0 };
        let start = KnotDerivatives::zeros();
        let untimed = UntimedPlan { nozzles, vehicle, heading_cost: 0.0, route, start };
        Ok(assemble_plan(&untimed, targets, &mut ClearanceChecker::new(surface, tool), settings, false)?.0)
    }
}

/// Nozzle positions and horizontal directions, smoothed stroke by stroke over arc length.
fn smooth(targets: &[Target], linked: &[bool], settings: &Settings) -> Vec<NozzleState> {
    let mut facing = first_facing(targets);
    let mut x = Vec::with_capacity(targets.len());
    let mut raw: Vec<[f64; 5]> = Vec::with_capacity(targets.len());
    let mut arc_length = 0.0;
    for (i, target) in targets.iter().enumerate() {
        // The normal of a floor has no horizontal part: keep facing as before.
        let flat = Vector3::new(target.normal.x, target.normal.y, 0.0);
        facing = flat.try_normalize(1e-6).unwrap_or(facing);
        if i > 0 {
            arc_length += (target.point - targets[i - 1].point).norm();
        }
        let p = target.point + facing * target.stand_off_or(settings.nozzle.stand_off);
        x.push(arc_length);
        raw.push([p.x, p.y, p.z, -facing.x, -facing.y]);
    }
    let mut result = Vec::with_capacity(targets.len());
    let mut first = 0;
    let ends = (1..=targets.len()).filter(|&end| end == targets.len() || !linked[end - 1]);
    for end in ends {
        let fitted = lowess(&x[first..end], &raw[first..end], &settings.lowess);
        for ([px, py, pz, cos, sin], raw) in fitted.iter().zip(&raw[first..end]) {
            let unsmoothed = UnitVector3::new_normalize(Vector3::new(raw[3], raw[4], 0.0));
            let direction = UnitVector3::try_new(Vector3::new(*cos, *sin, 0.0), 1e-6).unwrap_or(unsmoothed);
            result.push(NozzleState { position: Point3::new(*px, *py, *pz), direction });
        }
        first = end;
    }
    result
}

fn first_facing(targets: &[Target]) -> Vector3<f64> {
    let mut flats = targets.iter().map(|t| Vector3::new(t.normal.x, t.normal.y, 0.0));
    flats.find_map(|flat| flat.try_normalize(1e-6)).unwrap_or_else(Vector3::x)
}
