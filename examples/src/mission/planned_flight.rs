//! A planned layer for whoever flies it by himself: what he needs, and what his flight is worth.

use std::path::Path;

use paint_planner::Plan;
use paint_sim::flight::{FlightLog, Reference};
use paint_sim::spray::QUANTUM;
use paint_sim::surface::Hit;
use serde::Serialize;

use super::error::MissionError;
use super::figures::limit_violations;
use super::flight_conditions::counted_flight;
use super::flight_sensors::{Poses, camera_before};
use super::flyer::{Flight, Purpose};
use super::mission_output::texture;
use super::painted_views::save_painted_views;
use super::painting_task::PaintingTask;
use super::planned_mission::PlannedMission;
use super::shading::shading;
use super::simulated_flight::reference;
use super::spray_flights::{FlownPaint, Sprayed, spray};
use super::wet_surface::DriedSurface;
use crate::adapters::PlanReference;
use crate::appearance::DENSITY;
use crate::simulated_sensors::SHOT_STEP;

/// A layer of a mission that is planned and not flown.
#[derive(Clone, Copy)]
pub struct PlannedFlight<'a> {
    task: &'a PaintingTask,
    plan: &'a Plan,
    layer: u64,
}

/// What a flight is worth beside the errors of [`FlightLog::statistics`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct FlownFigures {
    /// Moments at which the plan exceeds a limit or the flown gun its joint limits.
    pub limit_violations: usize,
    /// Paint that left the nozzle, kg.
    pub paint_emitted_kg: f64,
    /// Paint on the surface, kg.
    pub paint_deposited_kg: f64,
}

impl PlannedMission {
    /// A flight of the mission, in flying order.
    pub fn flight(&self, layer: usize) -> Option<PlannedFlight<'_>> {
        let plan = &self.planned.layers.get(layer)?.plan;
        Some(PlannedFlight { task: &self.task, plan, layer: layer as u64 })
    }
}

impl<'a> PlannedFlight<'a> {
    /// The reference: what the flight is asked to do.
    pub fn reference(&self) -> PlanReference<'a> {
        reference(self.plan, &self.task.robot, &self.task.settings)
    }

    /// The flight itself, of its reference.
    pub fn flight<'b>(&self, reference: &'b dyn Reference) -> Flight<'b>
    where
        'a: 'b,
    {
        let conditions = counted_flight(self.plan, &self.task.robot, &self.task.settings, self.layer);
        Flight { task: self.task, purpose: Purpose::Paint, reference, conditions }
    }

    /// What says where the robot is, before the bare surface.
    pub fn poses(&self, flight: &Flight) -> Result<Poses<'a>, MissionError> {
        let poses = Poses::of(self.task, || camera_before(self.task, std::iter::empty()), 0, &flight.conditions)?;
        Ok(poses.with_faults(&self.task.settings.sensor_faults))
    }

    /// Puts the paint of a flight onto the surface, writes `painted.png` and `painted_view.png`, and counts.
    pub fn save(&self, log: &FlightLog, folder: &Path) -> Result<FlownFigures, MissionError> {
        let task = self.task;
        let (shots, duration) = (log.timed_shots(SHOT_STEP), log.samples.last().map_or(0.0, |sample| sample.time));
        let paint = FlownPaint { shots: &shots, duration, start: 0.0, on_dry: false };
        let Sprayed { surface: DriedSurface { film, pixels, .. }, .. } = spray([paint].into_iter(), task)?;
        let depth = task.depth_of(&film, &pixels);
        texture(task, &depth).save(&folder.join("painted.png"))?;
        save_painted_views(task, &|hit: &Hit| shading(task, &depth, hit), folder)?;
        let kilograms = |quanta: u64| quanta as f64 * QUANTUM * DENSITY;
        Ok(FlownFigures {
            limit_violations: limit_violations(self.plan, log, &task.settings),
            paint_emitted_kg: kilograms(film.mass_balance().emitted),
            paint_deposited_kg: kilograms(film.mass_balance().deposited),
        })
    }
}
