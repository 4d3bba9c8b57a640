//! What a person and a vehicle have before them.

use crate::world::{Surface, Tool};

/// The world of a session, borrowed for a step.
#[derive(Clone, Copy)]
pub struct TeleopScene<'a> {
    /// The part of the surface that can be painted or looked at, with the normals to paint along.
    pub canvas: &'a dyn Surface,
    /// Everything that the vehicle could touch.
    pub surface: &'a dyn Surface,
    /// The vehicle with its gun.
    pub tool: &'a dyn Tool,
}
