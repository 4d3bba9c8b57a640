//! Where the nozzle is: a robot that moves on as it was last seen to, and a nozzle that slides along its gantry.

use nalgebra::{Isometry3, Matrix3, Point3, Translation3, UnitQuaternion, UnitVector3, Vector3};

use crate::error::{Error, check_positive, check_range};

/// A nozzle in the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Nozzle {
    /// Its tip, m.
    pub origin: Point3<f64>,
    /// Spray direction.
    pub axis: UnitVector3<f64>,
    /// Across the axis: the second slope of the droplets is counted along it.
    pub up: UnitVector3<f64>,
}

impl Nozzle {
    /// Rows: left, up, along the spray.
    pub(super) fn rotation(&self) -> Matrix3<f64> {
        let left = self.up.cross(&self.axis);
        Matrix3::from_rows(&[left.transpose(), self.up.transpose(), self.axis.transpose()])
    }
}

/// The gantry on the robot. The nozzle sprays along the robot's x axis and slides along its z axis.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct GantryGeometry {
    /// Tip of the nozzle at gantry position 0, in the robot's frame, m (default: 50 mm below the robot's origin).
    pub robot_from_zero: Vector3<f64>,
    /// Length of the slide, m (default 0.1).
    pub travel: f64,
}

impl Default for GantryGeometry {
    fn default() -> Self {
        Self { robot_from_zero: Vector3::new(0.0, 0.0, -0.05), travel: 0.1 }
    }
}

impl GantryGeometry {
    /// Refuses what is no slide.
    ///
    /// # Errors
    /// A travel that is not positive, numbers that are not finite.
    pub fn check(&self) -> Result<(), Error> {
        check_positive("gantry.travel", self.travel)?;
        check_range("gantry.robot_from_zero", self.robot_from_zero.norm(), 0.0, 100.0, "finite and below 100 m")
    }

    /// The nozzle at a gantry position (m) of a robot.
    pub fn nozzle(&self, world_from_robot: &Isometry3<f64>, position: f64) -> Nozzle {
        let tip = self.robot_from_zero + Vector3::z() * position;
        Nozzle {
            origin: world_from_robot * Point3::from(tip),
            axis: world_from_robot.rotation * Vector3::x_axis(),
            up: world_from_robot.rotation * Vector3::z_axis(),
        }
    }
}

/// The robot's motion as it is extrapolated: constant velocity, constant angular velocity (handheld paper, Section VI-B).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sweep {
    /// Pose at time 0.
    pub world_from_robot: Isometry3<f64>,
    /// Velocity of the robot's origin in the world, m/s.
    pub velocity: Vector3<f64>,
    /// Angular velocity in the world, rad/s.
    pub angular_velocity: Vector3<f64>,
}

impl Sweep {
    /// A robot that stands still.
    pub fn still(world_from_robot: Isometry3<f64>) -> Self {
        Self { world_from_robot, velocity: Vector3::zeros(), angular_velocity: Vector3::zeros() }
    }

    /// Pose after `time` seconds.
    pub fn at(&self, time: f64) -> Isometry3<f64> {
        let rotation = UnitQuaternion::from_scaled_axis(self.angular_velocity * time) * self.world_from_robot.rotation;
        let position = self.world_from_robot.translation.vector + self.velocity * time;
        Isometry3::from_parts(Translation3::from(position), rotation)
    }

    /// Speed across gantry and spray of the point at `distance` along the spray from the middle of the gantry, m/s: the handheld paper's
    /// `v`, with the robot's turning.
    pub fn cross_speed(&self, gantry: &GantryGeometry, distance: f64, time: f64) -> f64 {
        let pose = self.at(time);
        let nozzle = gantry.nozzle(&pose, 0.5 * gantry.travel);
        let lever = nozzle.origin + nozzle.axis.into_inner() * distance - Point3::from(pose.translation.vector);
        let velocity = self.velocity + self.angular_velocity.cross(&lever);
        velocity.dot(&(pose.rotation * Vector3::y())).abs()
    }
}
