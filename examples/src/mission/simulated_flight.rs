//! A plan in the flight simulator: wind, hose, localisation, servos.

use nalgebra::{Point3, Vector3};
use paint_planner::Plan;
use paint_sim::flight::HoseModel;
use paint_sim::{FlightLog, FlightSettings, TriangleSurface};

use super::error::MissionError;
use super::settings::MissionSettings;
use crate::adapters::{PlanReference, Robot, ServoPanTilt};

/// The usual wind, hose and localisation.
pub(super) fn flight_settings(plan: &Plan, seed: u64) -> FlightSettings {
    FlightSettings { hose: Some(hose(plan)), seed, ..FlightSettings::default() }
}

/// Flies a plan with the robot's own servos.
pub(super) fn fly_plan(
    plan: &Plan,
    world: &TriangleSurface,
    robot: &Robot,
    settings: &MissionSettings,
    flight: &FlightSettings,
) -> Result<FlightLog, MissionError> {
    let reference = PlanReference {
        plan,
        chain: &robot.chain,
        gun_length: settings.ptu.tilt_from_tip.norm(),
        stand_off: settings.planner.nozzle.stand_off,
    };
    let mut gun = ServoPanTilt::new(robot.chain.clone(), settings.servo)?;
    Ok(paint_sim::fly(&reference, &mut gun, world, flight)?)
}

/// The paint hose: from the ground behind the middle of the flight, long enough for all of it.
fn hose(plan: &Plan) -> HoseModel {
    let positions = || plan.waypoints.iter().map(|w| w.state.position);
    let count = plan.waypoints.len() as f64;
    let middle: Vector3<f64> = positions().map(|p| p.coords).sum::<Vector3<f64>>() / count;
    let back: Vector3<f64> = plan
        .waypoints
        .iter()
        .map(|w| Vector3::new(w.state.heading.cos(), w.state.heading.sin(), 0.0))
        .sum::<Vector3<f64>>()
        / count;
    let base = Point3::new(middle.x - back.x, middle.y - back.y, 0.0);
    let farthest = positions().map(|p| (p - base).norm()).fold(0.0, f64::max);
    // A tenth of slack, and a metre for wind and overshoot.
    HoseModel { base, length: 1.1 * farthest + 1.0, line_density: 0.12, base_on_floor: true }
}
