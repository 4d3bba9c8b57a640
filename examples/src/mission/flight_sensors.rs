//! The sensors of a simulated flight: its camera before surface and paint, and what says where the robot is.

use nalgebra::Vector3;
use paint_sim::flight::{PoseSensor, PoseSource};
use paint_sim::{FlightSettings, Shot};

use super::error::MissionError;
use super::nozzle::spray_model;
use super::painting_task::PaintingTask;
use super::settings::LocalisationChoice;
use super::simulated_flight::noise;
use crate::onboard::{LocalisationFigures, LocalisedFlight, read_map};
use crate::simulated_sensors::{FaultInterval, PaintedFront, SimulatedCamera};

/// The camera before the true surface with the paint of shots on it. Surfaces are turned so that they face the robot, which is at smaller x.
pub(super) fn camera_before(
    task: &PaintingTask,
    shots: impl Iterator<Item = Shot>,
) -> Result<SimulatedCamera<'_>, MissionError> {
    let PaintingTask { settings, .. } = task;
    let towards = Vector3::x_axis();
    let mut painted = PaintedFront::new(task.met(), &towards, spray_model(settings), &task.paint.paint)?;
    painted.spray(&shots.collect::<Vec<_>>(), task.met(), settings.threads)?;
    // The same light and stone as in the scan.
    Ok(SimulatedCamera::new(task.met(), towards.into_inner(), settings.seed, settings.threads).before(painted))
}

/// What says where the robot is.
pub enum Poses<'a> {
    /// Motion capture, or a model of noise.
    Noise(PoseSensor),
    /// The robot's own senses.
    Own(Box<LocalisedFlight<'a>>),
}

impl<'a> Poses<'a> {
    /// Of a flight, as the task wants it: its own senses before a camera's view, or the noise of the flight's conditions.
    pub(super) fn of(
        task: &PaintingTask,
        camera: impl FnOnce() -> Result<SimulatedCamera<'a>, MissionError>,
        flight: u64,
        conditions: &FlightSettings,
    ) -> Result<Self, MissionError> {
        if task.settings.localisation != Some(LocalisationChoice::Slam) {
            return Ok(Self::Noise(noise(conditions)));
        }
        Ok(Self::Own(Box::new(localised_flight(task, camera()?, flight)?)))
    }

    /// With faults of the robot's own senses.
    #[must_use]
    pub(super) fn with_faults(self, faults: &[FaultInterval]) -> Self {
        match self {
            Self::Noise(_) => self,
            Self::Own(own) => Self::Own(Box::new(own.with_faults(faults.to_vec()))),
        }
    }

    /// As the flight asks for them.
    pub fn source(&mut self) -> &mut dyn PoseSource {
        match self {
            Self::Noise(sensor) => sensor,
            Self::Own(own) => own.as_mut(),
        }
    }

    /// What the robot's own localisation was worth.
    pub fn figures(&self) -> Option<LocalisationFigures> {
        match self {
            Self::Noise(_) => None,
            Self::Own(own) => Some(own.figures()),
        }
    }
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
