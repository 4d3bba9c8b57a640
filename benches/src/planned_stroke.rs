//! A stroke over the rock, planned by any planner, and its flights.

use std::error::Error;

use nalgebra::Point3;
use paint_planner::{Plan, Planner, Target};
use paint_sim::FlightSettings;
use paint_sim::flight::{
    CascadedController, Controller, ControllerSettings, FlightLog, HoseModel, Reference, fly_with,
};
use paintcopter::adapters::{MeshSurface, PlanReference, Robot, ServoPanTilt};
use paintcopter::mission::MissionSettings;
use paintcopter::surface::PaintSurface;
use ptu_kinematics::Ptu;

use crate::rock;

/// Targets of the stroke, 2.5 cm apart.
const TARGETS: usize = 800;

/// A stroke of 20 m over the rock with its plan.
pub struct PlannedStroke {
    /// The rock.
    pub surface: PaintSurface,
    /// The usual robot.
    pub robot: Robot,
    /// What the stroke serves.
    pub targets: Vec<Target>,
    /// Its plan.
    pub plan: Plan,
    /// Settings of planner and servos.
    pub settings: MissionSettings,
}

impl PlannedStroke {
    /// Plans the stroke.
    ///
    /// # Errors
    /// What the planner refuses.
    pub fn new(planner: &dyn Planner) -> Result<Self, Box<dyn Error>> {
        Self::with(planner, MissionSettings::default(), &|_| ())
    }

    /// Plans it by other settings, its targets changed.
    ///
    /// # Errors
    /// What the planner refuses.
    pub fn with(
        planner: &dyn Planner,
        settings: MissionSettings,
        change: &dyn Fn(&mut Vec<Target>),
    ) -> Result<Self, Box<dyn Error>> {
        let surface = rock::rock()?;
        let robot = Robot::new(Ptu::new(settings.ptu)?);
        let mut targets = rock::stroke(&surface, TARGETS);
        change(&mut targets);
        let plan = planner.plan(&targets, &MeshSurface(&surface.world), &robot, &settings.planner)?;
        Ok(Self { surface, robot, targets, plan, settings })
    }

    /// The plan as the simulator's reference.
    pub fn reference(&self) -> PlanReference<'_> {
        PlanReference {
            plan: &self.plan,
            chain: &self.robot.chain,
            gun_length: self.settings.ptu.tilt_from_tip.norm(),
            stand_off: self.settings.planner.nozzle.stand_off,
        }
    }

    /// Flies a reference before the rock.
    ///
    /// # Errors
    /// What the simulator refuses.
    pub fn fly(
        &self,
        reference: &dyn Reference,
        controller: &mut dyn Controller,
        settings: &FlightSettings,
    ) -> Result<FlightLog, Box<dyn Error>> {
        let mut gun = ServoPanTilt::new(self.robot.chain.clone(), self.settings.servo)?;
        Ok(fly_with(reference, controller, &mut gun, &self.surface.world, settings)?)
    }

    /// Flies the plan with the usual controller.
    ///
    /// # Errors
    /// What the simulator refuses.
    pub fn fly_plan(&self, settings: &FlightSettings) -> Result<FlightLog, Box<dyn Error>> {
        let mut controller = CascadedController::new(settings.airframe, ControllerSettings::default());
        self.fly(&self.reference(), &mut controller, settings)
    }
}

/// The paint hose from the ground behind the robot.
pub fn hose() -> HoseModel {
    HoseModel { base: Point3::new(-3.0, 0.0, 0.0), length: 9.0, line_density: 0.12, base_on_floor: true }
}
