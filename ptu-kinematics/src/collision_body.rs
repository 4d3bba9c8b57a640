//! The room that vehicle, arm and gun take.

use nalgebra::{Isometry3, Point3};

use crate::chain::KinematicChain;

/// Spheres that cover a flying robot in any pose: one about its rotors, a row along the arm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CollisionBody {
    /// Radius of the sphere about the body's origin that holds the rotors, metres (default 0.35).
    pub vehicle_radius: f64,
    /// Radius of arm and gun, metres (default 0.025).
    pub arm_radius: f64,
}

impl Default for CollisionBody {
    fn default() -> Self {
        Self { vehicle_radius: 0.35, arm_radius: 0.025 }
    }
}

impl CollisionBody {
    /// Appends (centre in world, radius) of the spheres about vehicle, arm and gun without its last centimetres: always the same number
    /// in the same order.
    ///
    /// ```
    /// # use ptu_kinematics::{CollisionBody, Joints, KinematicChain, Ptu, PtuSettings, nalgebra::Isometry3};
    /// let ptu = Ptu::new(PtuSettings::default())?;
    /// let mut spheres = Vec::new();
    /// CollisionBody::default().spheres(&ptu, &Isometry3::translation(0.0, 0.0, 2.0), &Joints { pan: 0.3, tilt: 0.0 }, &mut spheres);
    /// let (centre, radius) = spheres[0];
    /// assert_eq!((centre.z, radius), (2.0, 0.35));
    /// # Ok::<(), ptu_kinematics::Error>(())
    /// ```
    pub fn spheres<C: KinematicChain + ?Sized>(
        &self,
        chain: &C,
        world_from_body: &Isometry3<f64>,
        joints: &C::Joints,
        out: &mut Vec<(Point3<f64>, f64)>,
    ) {
        let body = Point3::from(world_from_body.translation.vector);
        let nozzle = chain.forward(world_from_body, joints);
        let mut members = chain.members(world_from_body, joints);
        // The sphere at the tip ends where the paint begins.
        if let Some(tip) = members.last_mut() {
            *tip = nozzle.tip - nozzle.direction.into_inner() * self.arm_radius;
        }
        out.push((body, self.vehicle_radius));
        if let Some(shoulder) = members.first() {
            for share in [0.75, 1.0] {
                out.push((body + (shoulder - body) * share, self.arm_radius));
            }
        }
        for member in members.windows(2) {
            for share in [0.33, 0.67, 1.0] {
                out.push((member[0] + (member[1] - member[0]) * share, self.arm_radius));
            }
        }
    }
}
