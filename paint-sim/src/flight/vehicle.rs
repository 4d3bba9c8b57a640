//! The multirotor: first-order attitude, thrust, drag.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use super::airframe::{Airframe, Command, GRAVITY};

/// The state of the vehicle. World frame z up; body frame x forward, y left, z up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Vehicle {
    /// Centre of the body, m.
    pub position: Point3<f64>,
    /// Its velocity, m/s.
    pub velocity: Vector3<f64>,
    /// Roll, pitch and yaw (`R = Rz(yaw) Ry(pitch) Rx(roll)`), rad.
    pub attitude: [f64; 3],
    /// Yaw rate, rad/s.
    pub yaw_rate: f64,
    /// Acceleration over the last step, m/s^2.
    pub acceleration: Vector3<f64>,
}

impl Vehicle {
    /// At rest with this heading.
    pub fn at_rest(position: Point3<f64>, heading: f64) -> Self {
        let zero = Vector3::zeros();
        Self { position, velocity: zero, attitude: [0.0, 0.0, heading], yaw_rate: 0.0, acceleration: zero }
    }

    /// Rotation of the body.
    pub fn rotation(&self) -> UnitQuaternion<f64> {
        let [roll, pitch, yaw] = self.attitude;
        UnitQuaternion::from_euler_angles(roll, pitch, yaw)
    }

    /// Pose of the body.
    pub fn world_from_body(&self) -> Isometry3<f64> {
        Isometry3::from_parts(Translation3::from(self.position), self.rotation())
    }

    /// Lets `dt` seconds pass under a command, a wind velocity (m/s) and a further force (N), both in the world:
    /// exact first-order attitude, then `v' = R e3 T/m - g e3 - R D R^T (v - wind) + F/m`, semi-implicit (the model of
    /// the thesis' and Paper II's controller with linear rotor drag).
    pub fn step(&mut self, airframe: &Airframe, command: &Command, wind: &Vector3<f64>, force: &Vector3<f64>, dt: f64) {
        self.attitude = airframe.attitude_after(self.attitude, self.yaw_rate, command, dt);
        self.yaw_rate = airframe.yaw_rate_after(self.yaw_rate, command.yaw_rate, dt);
        let rotation = self.rotation();
        let thrust = rotation * Vector3::new(0.0, 0.0, command.thrust / airframe.mass);
        let drag = airframe.drag_acceleration(&rotation, &(self.velocity - wind));
        self.acceleration = thrust - Vector3::new(0.0, 0.0, GRAVITY) + drag + force / airframe.mass;
        self.velocity += self.acceleration * dt;
        self.position += self.velocity * dt;
    }
}
