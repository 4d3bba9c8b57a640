//! The sensors of a simulated flight: its camera before surface and paint, and the localisation that it feeds.

use nalgebra::Vector3;
use paint_sim::flight::FlightLog;

use super::error::MissionError;
use super::nozzle::spray_model;
use super::painting_task::PaintingTask;
use crate::onboard::{LocalisedFlight, read_map};
use crate::simulated_sensors::{PaintedFront, SHOT_STEP, SimulatedCamera};

/// The camera before the true surface with the paint of flights on it. Surfaces are turned so that they face the robot, which is at smaller x.
pub(super) fn camera_before<'a, 'b>(
    task: &'a PaintingTask,
    flights: impl Iterator<Item = &'b FlightLog>,
) -> Result<SimulatedCamera<'a>, MissionError> {
    let PaintingTask { settings, .. } = task;
    let towards = Vector3::x_axis();
    let mut painted = PaintedFront::new(task.met(), &towards, spray_model(settings), &task.paint.paint)?;
    let shots: Vec<_> = flights.flat_map(|flight| flight.shots(SHOT_STEP)).collect();
    painted.spray(&shots, task.met(), settings.threads)?;
    // The same light and stone as in the scan.
    Ok(SimulatedCamera::new(task.met(), towards.into_inner(), settings.seed, settings.threads).before(painted))
}

/// The robot's own localisation in the map of the task; it finds itself anew. Flights of other numbers have other noise.
pub(super) fn localised_flight<'a>(
    task: &PaintingTask,
    camera: SimulatedCamera<'a>,
    flight: u64,
) -> Result<LocalisedFlight<'a>, MissionError> {
    let map = read_map(task.map().ok_or(MissionError::NoMap)?)?;
    Ok(LocalisedFlight::new(camera, map, task.settings.seed.wrapping_add(flight))?)
}
