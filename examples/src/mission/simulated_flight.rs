//! A plan in the flight simulator: wind, hose, localisation, servos.

use nalgebra::{Point3, Vector3};
use paint_planner::Plan;
use paint_planner::constraints::Tether;
use paint_planner::control::MpcSettings;
use paint_sim::flight::FlightLog;
use paint_sim::flight::{
    CONTROL_STEP, CascadedController, Controller, ControllerSettings, HoseModel, PoseSensor, PoseSource, Reference,
    fly_recorded,
};
use paint_sim::{FlightSettings, TriangleSurface};

use super::error::MissionError;
use super::settings::{ControllerChoice, MissionSettings};
use crate::adapters::{MpcController, PlanReference, Robot, ServoPanTilt};

/// The usual wind, hose and localisation.
pub(super) fn flight_settings(plan: &Plan, tether: Option<Tether>, seed: u64) -> FlightSettings {
    FlightSettings { hose: Some(hose(plan, tether)), seed, ..FlightSettings::default() }
}

/// A plan as the robot's reference.
pub(super) fn reference<'a>(plan: &'a Plan, robot: &'a Robot, settings: &MissionSettings) -> PlanReference<'a> {
    let gun_length = settings.ptu.tilt_from_tip.norm();
    PlanReference { plan, chain: &robot.chain, gun_length, stand_off: settings.planner.nozzle.stand_off }
}

/// Flies a plan by the noise of `flight`, see [`fly_reference`].
pub(super) fn fly_plan(
    plan: &Plan,
    world: &TriangleSurface,
    robot: &Robot,
    settings: &MissionSettings,
    flight: &FlightSettings,
) -> Result<FlightLog, MissionError> {
    let mut noise = noise(flight);
    let (log, ended) = fly_reference(&reference(plan, robot, settings), world, robot, settings, flight, &mut noise)?;
    ended.map_or(Ok(log), Err)
}

/// Poses with the noise of a flight.
pub(super) fn noise(flight: &FlightSettings) -> PoseSensor {
    PoseSensor::new(flight.localisation, CONTROL_STEP, flight.seed)
}

/// Flies a reference with the robot's own servos and the controller that was chosen, by a source of poses. Returns what was flown, and why it is
/// not all. The error is of a flight that does not begin.
pub(super) fn fly_reference(
    reference: &dyn Reference,
    world: &TriangleSurface,
    robot: &Robot,
    settings: &MissionSettings,
    flight: &FlightSettings,
    poses: &mut dyn PoseSource,
) -> Result<(FlightLog, Option<MissionError>), MissionError> {
    let mut gun = ServoPanTilt::new(robot.chain.clone(), settings.servo)?;
    let mut controller: Box<dyn Controller> = match settings.controller {
        ControllerChoice::Cascade => Box::new(CascadedController::new(flight.model(), ControllerSettings::default())),
        ControllerChoice::Mpc => Box::new(MpcController::new(&flight.model(), MpcSettings::default())?),
    };
    let mut log = FlightLog::default();
    match fly_recorded(reference, controller.as_mut(), &mut gun, world, poses, flight, &mut log) {
        Err(error) if log.samples.is_empty() => Err(error.into()),
        ended => Ok((log, ended.err().map(MissionError::from))),
    }
}

/// The paint hose: from its anchor, or from the ground behind the middle of the flight, long enough for all of it.
fn hose(plan: &Plan, tether: Option<Tether>) -> HoseModel {
    let positions = || plan.waypoints.iter().map(|w| w.state.position);
    let count = plan.waypoints.len() as f64;
    let middle: Vector3<f64> = positions().map(|p| p.coords).sum::<Vector3<f64>>() / count;
    let back: Vector3<f64> = plan
        .waypoints
        .iter()
        .map(|w| Vector3::new(w.state.heading.cos(), w.state.heading.sin(), 0.0))
        .sum::<Vector3<f64>>()
        / count;
    let base = tether.map_or_else(|| Point3::new(middle.x - back.x, middle.y - back.y, 0.0), |tether| tether.anchor);
    let farthest = positions().map(|p| (p - base).norm()).fold(0.0, f64::max);
    // A tenth of slack, and a metre for wind and overshoot.
    HoseModel { base, length: 1.1 * farthest + 1.0, line_density: 0.12, base_on_floor: base.z <= 0.0 }
}

#[cfg(test)]
mod tests {
    use paint_planner::timing::TimingPolicy;
    use paint_sim::flight::{Faults, Gust, Interlock, Valve, Wind};
    use ptu_kinematics::Ptu;

    use super::super::test_panel;
    use super::*;

    /// Nothing says where it is when the gust comes: it is blown away until the hose is taut. What it has painted before is in the log.
    #[test]
    fn a_flight_that_ends_in_the_air_leaves_what_was_flown() {
        let mut settings = MissionSettings { threads: 1, ..MissionSettings::default() };
        settings.planner.timing.policy = TimingPolicy::Uniform { speed: 0.05 };
        let surface = test_panel::surface();
        let robot = Robot::new(Ptu::new(settings.ptu).unwrap());
        let plan = test_panel::plan(&surface, &robot, &settings);
        let usual = flight_settings(&plan, None, 1);
        let gust = Some(Gust { time: 8.0, velocity: Vector3::new(-15.0, 0.0, 0.0) });
        let faults = Faults { pose_lost: Some(8.0), gust, ..Faults::default() };
        let valve = Valve { interlock: Some(Interlock::default()), ..usual.valve };
        let flight = FlightSettings { faults, valve, ..usual };
        let reference = reference(&plan, &robot, &settings);
        let mut poses = noise(&flight);
        let (log, ended) = fly_reference(&reference, &surface.world, &robot, &settings, &flight, &mut poses).unwrap();
        let last = log.samples.last().unwrap().time;
        assert!(ended.is_some() && (8.5..plan.trajectory.duration() - 1.0).contains(&last), "{ended:?} {last}");
        let whole = fly_plan(&plan, &surface.world, &robot, &settings, &FlightSettings { valve, ..usual }).unwrap();
        for (k, (sample, same)) in log.samples.iter().zip(&whole.samples).enumerate() {
            assert!(sample == same || sample.time > 7.999, "{k}");
            assert!(sample.flow == 0.0 || sample.time < 8.1, "{k}");
        }
    }

    #[test]
    fn in_strong_gusts_the_predictive_controller_keeps_the_distance_better() {
        let settings = MissionSettings { threads: 1, ..MissionSettings::default() };
        let surface = test_panel::surface();
        let robot = Robot::new(Ptu::new(settings.ptu).unwrap());
        let plan = test_panel::plan(&surface, &robot, &settings);
        let distance = |controller| {
            let settings = MissionSettings { controller, ..settings.clone() };
            let wind = Wind { mean: Vector3::zeros(), gust_sigma: 3.0, ..Wind::default() };
            let spread = (0..12).map(|seed| {
                let flight = FlightSettings { wind, ..flight_settings(&plan, None, seed) };
                let log = fly_plan(&plan, &surface.world, &robot, &settings, &flight).unwrap();
                log.statistics().nozzle_distance_std.powi(2)
            });
            (spread.sum::<f64>() / 12.0).sqrt()
        };
        let (cascade, mpc) = (distance(ControllerChoice::Cascade), distance(ControllerChoice::Mpc));
        assert!(mpc < 0.7 * cascade, "{mpc} m, {cascade} m by the cascade");
    }
}
