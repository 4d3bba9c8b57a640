//! The simulated robot before its surface: by motion capture, by noise, or by its own senses.

use nalgebra::{Isometry3, Point3, Vector3};
use paint_sim::flight::multirotor::MultirotorSettings;
use paint_sim::flight::{PoseSensor, PoseSource, Reference};

use super::error::RobotError;
use super::fault::Fault;
use super::flight::{Flown, Scene, fly_px4};
use super::on_board::{CONTROL_STEP, OnBoard, OnBoardSettings};
use super::simulated_robot::{SimulatedRobot, station};
use crate::autopilot::{AutopilotError, Px4, Px4Vehicle};
use crate::mission::PlannedFlight;
use crate::onboard::{Approach, LocalisationFigures, StandingStart};

/// The middle of the stand is so far behind everything that is flown to, m, and the plan is looked at so often, s.
const BEHIND: f64 = 1.0;
const LOOK: f64 = 0.1;

/// Flies a planned layer on a PX4, which `launch` starts for a vehicle, with the settings of a hover thrust. Returns what its own localisation was
/// worth, if it flew by that.
pub(super) fn fly_simulated(
    flight: &PlannedFlight,
    settings: &dyn Fn(f64) -> OnBoardSettings,
    launch: &dyn Fn(&Px4Vehicle) -> Result<Px4, AutopilotError>,
    faults: &[Fault],
    progress: &mut dyn FnMut(f64),
) -> Result<(Flown, Option<LocalisationFigures>), RobotError> {
    let conditions = flight.conditions();
    let plan = flight.reference();
    let start = plan.at(0.0);
    let mut own = flight.own_senses()?;
    let station = match own {
        Some(_) => stand(&plan, flight.corners()),
        None => station(&start.position, start.heading),
    };
    let mut sensor = PoseSensor::new(conditions.localisation, CONTROL_STEP, conditions.seed);
    let mut standing = own.as_mut().map(StandingStart);
    let senses: &mut dyn PoseSource = match &mut standing {
        Some(standing) => standing,
        None => &mut sensor,
    };
    let vehicle = MultirotorSettings::default();
    let mut robot = SimulatedRobot::new(vehicle, &station, flight.pan_tilt()?, senses, &conditions)?;
    let settings = settings(robot.body().hover_command());
    let mut on_board = OnBoard::new(&plan, flight.pan_tilt()?, settings);
    let vehicle = Px4Vehicle {
        hover_thrust: settings.hover_thrust,
        max_speed: flight.settings().planner.timing.max_speed,
        max_tilt: settings.airframe.tilt_limit,
    };
    let scene = Scene { plan: &plan, surface: flight.surface(), faults };
    let flown = fly_px4(&|| launch(&vehicle), &mut robot, &mut on_board, &scene, progress)?;
    Ok((flown, own.map(|own| own.figures())))
}

/// A station from which the camera sees a surface within two corners before the robot takes off. The surface faces smaller x; the stand is not
/// in the way of the plan.
fn stand(plan: &dyn Reference, corners: [Point3<f64>; 2]) -> Isometry3<f64> {
    let place = Approach::before(plan, corners).at(0.0);
    let steps = (plan.duration() / LOOK).ceil() as usize;
    let farthest = (0..=steps).map(|step| plan.at(LOOK * step as f64).position.x).fold(f64::INFINITY, f64::min);
    let Point3 { coords, .. } = place.position;
    Isometry3::new(Vector3::new(coords.x.min(farthest - BEHIND), coords.y, coords.z), Vector3::z() * place.heading)
}
