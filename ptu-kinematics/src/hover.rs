//! Poses: the nozzle, and the hovering robot that holds it.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, UnitVector3, Vector3};

use crate::joints::Joints;

/// The nozzle in the world: tip and spray direction (out of the gun).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Nozzle {
    /// `p`, in metres.
    pub tip: Point3<f64>,
    /// `h`, unit length.
    pub direction: UnitVector3<f64>,
}

/// A hovering robot: level body at a position and heading, and its joint angles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hover<J = Joints> {
    /// Body origin `r` in the world, metres.
    pub position: Point3<f64>,
    /// Heading `ψ` about the world's up axis, radians.
    pub heading: f64,
    /// Joint angles; pan and tilt for the pan-tilt unit.
    pub joints: J,
}

impl<J> Hover<J> {
    /// The body pose: `Rz(ψ)` at `r`.
    pub fn world_from_body(&self) -> Isometry3<f64> {
        Isometry3::from_parts(
            Translation3::from(self.position),
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), self.heading),
        )
    }
}
