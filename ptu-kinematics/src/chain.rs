//! What the rest of a painting robot needs to know of its arm.

use nalgebra::{Isometry3, Matrix6xX, Point3, UnitVector3};

use crate::error::Error;
use crate::hover::{Hover, Nozzle};
use crate::joints::Range;

/// An arm between the body of a flying robot and its nozzle: forward and inverse kinematics, Jacobian, joint limits.
///
/// The body hovers level and can stand anywhere, so the inverse finds a body position along with the joints. The
/// pan-tilt unit ([`Ptu`](crate::Ptu)) solves it in closed form, a serial arm ([`SerialArm`](crate::SerialArm))
/// numerically. Frames: body `x` forward, `y` left, `z` up; metres and radians.
pub trait KinematicChain: Sync {
    /// One value per joint, in the order of [`limits`](Self::limits).
    type Joints: Clone;

    /// Joint limits, from the body to the nozzle.
    fn limits(&self) -> Vec<Range>;

    /// The nozzle for any pose of the body.
    fn forward(&self, world_from_body: &Isometry3<f64>, joints: &Self::Joints) -> Nozzle;

    /// Joints that turn the spray axis to an azimuth (about the body's up axis, left positive) and an elevation (up
    /// positive), both relative to a level body. Limits are not checked; an arm that cannot reach the direction comes as
    /// near as it can.
    fn point(&self, azimuth: f64, elevation: f64) -> Self::Joints;

    /// Azimuth and elevation of the spray axis in body axes, radians: what [`point`](Self::point) undoes.
    fn spray_angles(&self, joints: &Self::Joints) -> [f64; 2] {
        let axis = self.forward(&Isometry3::identity(), joints).direction;
        [axis.y.atan2(axis.x), axis.z.atan2(axis.x.hypot(axis.y))]
    }

    /// Inverse kinematics in hover: body position and joints that bring the nozzle tip to `tip` (world, metres) spraying
    /// along `direction`, with the body at `heading`.
    ///
    /// # Errors
    /// Input that is not finite, or a direction that the joints cannot reach within their limits.
    fn inverse(
        &self,
        tip: &Point3<f64>,
        direction: &UnitVector3<f64>,
        heading: f64,
    ) -> Result<Hover<Self::Joints>, Error>;

    /// `∂(p, h) / ∂(r, ψ, θ)`: rows are tip (3) and direction (3), columns body position (3), heading, then the joints.
    fn jacobian(&self, hover: &Hover<Self::Joints>) -> Matrix6xX<f64>;

    /// Ends of the arm's straight members in the world, from where it leaves the body to the nozzle tip: what a collision
    /// body is built around. Always the same number.
    fn members(&self, world_from_body: &Isometry3<f64>, joints: &Self::Joints) -> Vec<Point3<f64>>;
}
