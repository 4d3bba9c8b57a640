//! What the gantry planner needs to know of the world.

use super::lattice::Segment;

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
