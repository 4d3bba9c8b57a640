//! The simulated robot before its surface: by motion capture, by noise, or by its own senses.

use nalgebra::{Isometry3, Point3, Vector3};
use paint_sim::flight::multirotor::MultirotorSettings;
use paint_sim::flight::{PoseSource, Reference};

use super::error::RobotError;
use super::fault::Fault;
use super::flight::{Flown, Scene, fly_px4};
use super::on_board::{OnBoard, OnBoardSettings};
use super::simulated_robot::{SimulatedRobot, station};
use crate::autopilot::{AutopilotError, Px4, Px4Vehicle};
use crate::mission::Flight;
use crate::onboard::Approach;

/// The middle of the stand is so far behind everything that is flown to, m (robot and stand are half as wide together, and a little), and the
/// plan is looked at so often, s.
const BEHIND: f64 = 0.7;
const LOOK: f64 = 0.1;

/// Flies a flight of a mission on a PX4, which `launch` starts for a vehicle, by a source of poses, with the settings of a hover thrust.
pub(super) fn fly_simulated(
    flight: &Flight,
    poses: &mut dyn PoseSource,
    settings: &dyn Fn(f64) -> OnBoardSettings,
    launch: &dyn Fn(&Px4Vehicle) -> Result<Px4, AutopilotError>,
    faults: &[Fault],
    progress: &mut dyn FnMut(f64),
) -> Result<Flown, RobotError> {
    let plan = flight.reference;
    let start = plan.at(0.0);
    let station = if flight.is_by_own_senses() { stand(flight) } else { station(&start.position, start.heading) };
    let vehicle = MultirotorSettings::default();
    let mut robot = SimulatedRobot::new(vehicle, &station, flight.pan_tilt()?, poses, &flight.conditions)?;
    let settings = settings(robot.body().hover_command());
    let mut on_board = OnBoard::new(plan, flight.pan_tilt()?, settings);
    let vehicle = Px4Vehicle {
        hover_thrust: settings.hover_thrust,
        max_speed: flight.settings().planner.timing.max_speed,
        max_tilt: settings.airframe.tilt_limit,
    };
    let scene = Scene { plan, surface: flight.surface(), faults };
    fly_px4(&|| launch(&vehicle), &mut robot, &mut on_board, &scene, progress)
}

/// A station from which the camera sees the surface before the robot takes off. The surface faces smaller x; the stand is not in the way of the
/// plan.
fn stand(flight: &Flight) -> Isometry3<f64> {
    let plan = flight.reference;
    let place = Approach::before(plan, flight.purpose.stands_back(), flight.corners()).at(0.0);
    let steps = (plan.duration() / LOOK).ceil() as usize;
    let farthest = (0..=steps).map(|step| plan.at(LOOK * step as f64).position.x).fold(f64::INFINITY, f64::min);
    let Point3 { coords, .. } = place.position;
    Isometry3::new(Vector3::new(coords.x.min(farthest - BEHIND), coords.y, coords.z), Vector3::z() * place.heading)
}
