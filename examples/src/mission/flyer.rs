//! Who flies: the built-in simulation, or a program that has an autopilot.

use nalgebra::Point3;
use paint_sim::flight::{FlightLog, PoseSource, Reference};
use paint_sim::{FlightSettings, TriangleSurface};

use super::collisions::collisions;
use super::error::MissionError;
use super::painting_task::PaintingTask;
use super::settings::{LocalisationChoice, MissionSettings};
use crate::adapters::{MeshSurface, Robot, ServoPanTilt};

/// What a flight is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Purpose {
    /// It paints.
    Paint,
    /// It takes pictures of what is painted.
    Look,
}

impl Purpose {
    /// A robot that does not know where it is stands back by so much from where its flight begins, m: then it is about as far from the surface as
    /// when it scanned it, and the keyframes show what it sees.
    pub fn stands_back(self) -> f64 {
        match self {
            Self::Paint => 0.9,
            Self::Look => 0.6,
        }
    }
}

/// A flight of a mission.
#[derive(Clone, Copy)]
pub struct Flight<'a> {
    pub(super) task: &'a PaintingTask,
    /// What it is for.
    pub purpose: Purpose,
    /// What it is asked to do, by its own clock: a plan, a piece of one, or a way along the surface.
    pub reference: &'a dyn Reference,
    /// Wind, hose, vehicle, valve, faults and seed.
    pub conditions: FlightSettings,
}

impl<'a> Flight<'a> {
    /// Whether its poses are those of the robot's own senses, which find themselves in a map before anything is flown.
    pub fn is_by_own_senses(&self) -> bool {
        self.task.settings.localisation == Some(LocalisationChoice::Slam)
    }

    /// The pan-tilt unit on its servos, at rest.
    pub fn pan_tilt(&self) -> Result<ServoPanTilt, MissionError> {
        Ok(ServoPanTilt::new(self.robot().chain.clone(), self.settings().servo)?)
    }

    /// The surface that the spray meets.
    pub fn surface(&self) -> &'a TriangleSurface {
        self.task.met()
    }

    /// Least and largest coordinates of the surface that is painted.
    pub fn corners(&self) -> [Point3<f64>; 2] {
        self.task.surface.corners()
    }

    /// What the mission was told.
    pub fn settings(&self) -> &'a MissionSettings {
        &self.task.settings
    }

    /// Moments of a log at which the robot touches the surface.
    pub fn collisions(&self, log: &FlightLog) -> usize {
        let met = MeshSurface(self.surface());
        collisions(self.robot(), &self.settings().constraints.around(&met), log)
    }

    fn robot(&self) -> &'a Robot {
        &self.task.robot
    }
}

/// Flies the flights of a mission, one after another.
pub trait Flyer {
    /// Flies by a source of poses; `tell` hears how much of the reference is flown, s. Returns what was flown, by the reference's time, and
    /// what has ended it in the air.
    ///
    /// # Errors
    /// A flight that does not come to its reference.
    fn fly(
        &mut self,
        flight: &Flight,
        poses: &mut dyn PoseSource,
        tell: &dyn Fn(f64),
    ) -> Result<(FlightLog, Option<MissionError>), MissionError>;
}
