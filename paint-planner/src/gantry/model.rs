//! What the gantry planner and its controller need to know of paint.

use nalgebra::Isometry3;

use super::lattice::Segment;
use super::robot_motion::RobotMotion;
use crate::error::Error;
use crate::world::Surface;

/// A place that the nozzle could be at.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GantrySample {
    /// Seconds after the plan's start.
    pub time: f64,
    /// Position along the gantry, m.
    pub position: f64,
    /// Flux that the nozzle sprays there, in the unit of the density: a ray whose need is larger counts with so much, because one pass can
    /// place no more. Infinite where Eq. (1) is taken as printed.
    pub saturation: f64,
}

/// Paint, surface and moving robot, as seen at the start of a plan.
pub trait PaintModel {
    /// Required paint density at each sample (handheld paper, Eq. (1)), in the unit of [`GantrySettings::flux_speed`] over a speed; one value
    /// for each sample, in order, zero where the spray meets nothing.
    ///
    /// [`GantrySettings::flux_speed`]: super::GantrySettings::flux_speed
    fn required_density(&mut self, samples: &[GantrySample]) -> Vec<f32>;

    /// Speed of the robot across its gantry at a time after the plan's start, m/s: the `v` of Eq. (2).
    fn cross_speed(&self, time: f64) -> f64;

    /// Paint that a path from the plan's start would place, m^3, by simulation (Section V). Leaves the paint as it is.
    fn simulate(&mut self, path: &[Segment]) -> f64;
}

/// Where spray lands on the object, and whether it does good there: what a [`Controller`](super::Controller) asks of a simulation of paint.
///
/// Poses are those of the robot as seen from the object's model (`model_from_robot`); gantry positions are metres along the slide. Time steps
/// are those of the controller's frames.
pub trait DepositModel {
    /// The paint on the object.
    type Deposit: Clone;
    /// Where the spray of one time step lands.
    type Footprint;
    /// Why a forecast may fail.
    type Error: From<Error>;

    /// Surface of the object in its model's place, against which measured distances are held.
    fn surface(&self) -> &dyn Surface;

    /// Where the nozzle sprays during a time step, from its pose in the middle of the step. A model that samples its spray may take another
    /// sample for each number of a step.
    fn footprint(&self, model_from_robot: &Isometry3<f64>, position: f64, step: usize) -> Self::Footprint;

    /// What a whole step of spray is worth there (the sum `S` of handheld paper, Eqs. (6) and (7)): positive where it does more good than harm.
    fn score(&self, footprint: &Self::Footprint, deposit: &Self::Deposit) -> f64;

    /// Adds the spray of a step in which the valve is open for the share `open`.
    fn spray(&self, footprint: &Self::Footprint, open: f64, deposit: &mut Self::Deposit);

    /// Calls `plan` with the paint as it would go on from `deposit` under a robot that moves on as `motion` says; time 0 is that of `motion`.
    ///
    /// # Errors
    /// What `plan` returns, or what the model cannot compute.
    fn forecast<R>(
        &mut self,
        deposit: &Self::Deposit,
        motion: &RobotMotion,
        plan: impl FnOnce(&mut dyn PaintModel) -> Result<R, Error>,
    ) -> Result<R, Self::Error>;
}
