//! A pose in a map, and where it leads.

use nalgebra::{Isometry3, UnitQuaternion, Vector3};

use crate::stamp::Stamp;

/// A pose with the velocities since the one before: m/s and rad/s along the world's axes.
#[derive(Debug, Clone, Copy)]
pub(super) struct MapPose {
    pub(super) stamp: Stamp,
    pub(super) world_from_body: Isometry3<f64>,
    pub(super) velocity: Vector3<f64>,
    rate: Vector3<f64>,
}

impl MapPose {
    /// After another one; at rest without.
    pub(super) fn next(before: Option<Self>, stamp: Stamp, world_from_body: Isometry3<f64>) -> Self {
        let since = |before: Self| {
            let dt = stamp.secs_since(before.stamp).max(1e-3);
            let way = world_from_body.translation.vector - before.world_from_body.translation.vector;
            let turn = (world_from_body.rotation * before.world_from_body.rotation.inverse()).scaled_axis();
            (way / dt, turn / dt)
        };
        let (velocity, rate) = before.map_or_else(Default::default, since);
        Self { stamp, world_from_body, velocity, rate }
    }

    /// The pose at another time, at constant velocities.
    pub(super) fn after(&self, stamp: Stamp) -> Isometry3<f64> {
        let dt = stamp.secs_since(self.stamp);
        let rotation = UnitQuaternion::from_scaled_axis(self.rate * dt) * self.world_from_body.rotation;
        Isometry3::from_parts((self.world_from_body.translation.vector + self.velocity * dt).into(), rotation)
    }
}
