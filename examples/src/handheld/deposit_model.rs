//! The simulator's droplets as the paint of the gantry's controller.

use nalgebra::Isometry3;
use paint_planner::Error;
use paint_planner::gantry::{DepositModel, PaintModel, RobotMotion};
use paint_sim::TriangleSurface;
use paint_sim::droplets::{Coverage, StepHits, Sweep};

use super::error::HandheldError;
use super::forecast::{Forecast, PaintDevice, PaintJob};
use crate::adapters::MeshSurface;

/// Paint in the texels of an object.
pub struct SimulatedDeposit<'a> {
    job: &'a PaintJob<'a>,
    world: MeshSurface<'a>,
    device: &'a mut dyn PaintDevice,
}

impl<'a> SimulatedDeposit<'a> {
    /// On the object of a job, whose triangles `world` are; densities and candidates are computed on a device.
    pub fn new(job: &'a PaintJob<'a>, world: &'a TriangleSurface, device: &'a mut dyn PaintDevice) -> Self {
        Self { job, world: MeshSurface(world), device }
    }
}

impl DepositModel for SimulatedDeposit<'_> {
    type Deposit = Coverage;
    type Footprint = StepHits;
    type Error = HandheldError;

    fn surface(&self) -> &dyn paint_planner::Surface {
        &self.world
    }

    fn footprint(&self, model_from_robot: &Isometry3<f64>, position: f64, step: usize) -> StepHits {
        self.job.hits(model_from_robot, position, step)
    }

    fn score(&self, footprint: &StepHits, deposit: &Coverage) -> f64 {
        self.job.score(footprint, deposit)
    }

    fn spray(&self, footprint: &StepHits, open: f64, deposit: &mut Coverage) {
        let droplet = self.job.settings.deposit.droplet();
        deposit.spray(footprint, (open * droplet as f64).round() as u64);
    }

    fn forecast<R>(
        &mut self,
        deposit: &Coverage,
        motion: &RobotMotion,
        plan: impl FnOnce(&mut dyn PaintModel) -> Result<R, Error>,
    ) -> Result<R, HandheldError> {
        let RobotMotion { world_from_robot, velocity, angular_velocity } = *motion;
        let sweep = Sweep { world_from_robot, velocity, angular_velocity };
        let mut forecast = Forecast::new(self.job, deposit, self.device, &sweep)?;
        let planned = plan(&mut forecast)?;
        forecast.check()?;
        Ok(planned)
    }
}
