//! A planned layer for whoever flies it by himself: what he needs, and what his flight is worth.

use std::path::Path;

use nalgebra::Point3;
use paint_planner::Plan;
use paint_sim::flight::FlightLog;
use paint_sim::spray::QUANTUM;
use paint_sim::{FlightSettings, TriangleSurface};

use super::error::MissionError;
use super::figures::{collisions, limit_violations};
use super::fly::{Sprayed, counted_flight, onboard, spray};
use super::mission_output::{painted_view, texture};
use super::painting_task::PaintingTask;
use super::planned_mission::PlannedMission;
use super::settings::MissionSettings;
use super::simulated_flight::reference;
use crate::adapters::{MeshSurface, PlanReference, ServoPanTilt};
use crate::appearance::DENSITY;
use crate::onboard::LocalisedFlight;

/// A layer of a mission that is planned and not flown.
#[derive(Clone, Copy)]
pub struct PlannedFlight<'a> {
    task: &'a PaintingTask,
    plan: &'a Plan,
    layer: u64,
}

/// What a flight is worth beside the errors of [`FlightLog::statistics`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FlownFigures {
    /// Moments at which the robot touched the surface.
    pub collisions: usize,
    /// Moments at which the plan exceeds a limit or the flown gun its joint limits.
    pub limit_violations: usize,
    /// Paint that left the nozzle, kg.
    pub emitted: f64,
    /// Paint on the surface, kg.
    pub deposited: f64,
}

impl PlannedMission {
    /// A flight of the mission, in flying order.
    pub fn flight(&self, layer: usize) -> Option<PlannedFlight<'_>> {
        let (_, plan, _) = self.planned.layers.get(layer)?;
        Some(PlannedFlight { task: &self.task, plan, layer: layer as u64 })
    }
}

impl<'a> PlannedFlight<'a> {
    /// The reference: what the flight is asked to do.
    pub fn reference(&self) -> PlanReference<'a> {
        reference(self.plan, &self.task.robot, &self.task.settings)
    }

    /// The pan-tilt unit on its servos, at rest.
    pub fn pan_tilt(&self) -> Result<ServoPanTilt, MissionError> {
        Ok(ServoPanTilt::new(self.task.robot.chain.clone(), self.task.settings.servo)?)
    }

    /// The surface that the spray meets.
    pub fn surface(&self) -> &'a TriangleSurface {
        self.task.met()
    }

    /// What the mission was told.
    pub fn settings(&self) -> &'a MissionSettings {
        &self.task.settings
    }

    /// Wind, hose, localisation and valve as the built-in simulation flies it.
    pub fn conditions(&self) -> FlightSettings {
        counted_flight(self.plan, &self.task.robot, &self.task.settings, self.layer)
    }

    /// The robot's own localisation before the bare surface, if it is to fly by that.
    pub fn own_senses(&self) -> Result<Option<LocalisedFlight<'a>>, MissionError> {
        onboard(self.task, std::iter::empty())
    }

    /// Least and largest coordinates of the surface that is painted.
    pub fn corners(&self) -> [Point3<f64>; 2] {
        self.task.surface.corners()
    }

    /// Puts the paint of a flight onto the surface, writes `painted.png` and `painted_view.png`, and counts. `ways`: samples without paint.
    pub fn save(&self, log: &FlightLog, ways: &FlightLog, folder: &Path) -> Result<FlownFigures, MissionError> {
        let task = self.task;
        let Sprayed { film, pixels, .. } = spray(std::iter::once(log), task)?;
        let depth = task.depth_of(&film, &pixels);
        texture(task, &depth).save(&folder.join("painted.png"))?;
        painted_view(task, &depth)?.save(&folder.join("painted_view.png"))?;
        let met = MeshSurface(task.met());
        let kilograms = |quanta: u64| quanta as f64 * QUANTUM * DENSITY;
        let collisions = |log| collisions(&task.robot, &task.settings.constraints.around(&met), log);
        Ok(FlownFigures {
            collisions: collisions(log) + collisions(ways),
            limit_violations: limit_violations(self.plan, log, &task.settings),
            emitted: kilograms(film.mass_balance().emitted),
            deposited: kilograms(film.mass_balance().deposited),
        })
    }
}
