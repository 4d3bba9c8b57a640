//! How the robot moves at one moment.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

/// Pose and velocities as they are believed to be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RobotMotion {
    /// Pose.
    pub world_from_robot: Isometry3<f64>,
    /// Velocity of the robot's origin in the world, m/s.
    pub velocity: Vector3<f64>,
    /// Angular velocity in the world, rad/s.
    pub angular_velocity: Vector3<f64>,
}

impl RobotMotion {
    /// Pose after `time` seconds at these velocities.
    pub fn after(&self, time: f64) -> Isometry3<f64> {
        let turned = UnitQuaternion::from_scaled_axis(self.angular_velocity * time) * self.world_from_robot.rotation;
        let place = self.world_from_robot.translation.vector + self.velocity * time;
        Isometry3::from_parts(Translation3::from(place), turned)
    }
}
