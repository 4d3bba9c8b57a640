//! What acts on the vehicle beside its rotors.

use nalgebra::{Point3, Vector3};

/// A force on a point of the body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Load {
    /// The force, world frame, N.
    pub force: Vector3<f64>,
    /// Where it acts, body frame, m.
    pub point: Point3<f64>,
}

impl Load {
    /// The recoil of a spray: `-mass_flow exit_speed axis` at the nozzle. Mass flow in kg/s, speed in m/s, axis in the world.
    pub fn recoil(mass_flow: f64, exit_speed: f64, axis: &Vector3<f64>, nozzle: Point3<f64>) -> Self {
        Self { force: -mass_flow * exit_speed * axis, point: nozzle }
    }
}

/// What acts on the vehicle beside its rotors during a step.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Surroundings<'a> {
    /// Velocity of the air, world frame, m/s.
    pub wind: Vector3<f64>,
    /// Hose, recoil, and what else pulls.
    pub loads: &'a [Load],
    /// Paint that leaves the tank on board, kg/s; less where the tank ends.
    pub outflow: f64,
    /// Height at which the body's centre rests on the ground, m; `None` without ground.
    pub ground: Option<f64>,
}
