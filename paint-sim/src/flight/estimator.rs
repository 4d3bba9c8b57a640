//! What the controller knows: velocity and disturbance from noisy poses, by a model-aided observer.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use super::airframe::{Airframe, Command, GRAVITY};
use super::vehicle::Vehicle;

/// The estimated state, and the acceleration that the model does not explain.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// Centre of the body, world frame, m.
    pub position: Point3<f64>,
    /// Its velocity, m/s.
    pub velocity: Vector3<f64>,
    /// Disturbance: wind, hose and errors of the model as an acceleration, m/s^2.
    pub disturbance: Vector3<f64>,
    /// Roll, pitch and yaw, rad; yaw is continuous, not wrapped.
    pub attitude: [f64; 3],
    /// Yaw rate, rad/s.
    pub yaw_rate: f64,
}

/// Bandwidths of the observer.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct ObserverSettings {
    /// Triple pole of position, velocity and disturbance, rad/s. Default 16.
    pub translation: f64,
    /// Pole of roll and pitch, double pole of yaw and yaw rate, rad/s. Default 12.
    pub attitude: f64,
}

impl Default for ObserverSettings {
    fn default() -> Self {
        Self { translation: 16.0, attitude: 12.0 }
    }
}

/// Luenberger observer on the vehicle's own model: between two poses it moves the estimate by the model under the last
/// command, then corrects it by the difference to the measured pose.
#[derive(Debug, Clone)]
pub struct Estimator {
    airframe: Airframe,
    settings: ObserverSettings,
    estimate: Estimate,
    command: Command,
    /// See [`Estimator::innovation`].
    innovation: f64,
}

impl Estimator {
    /// Starts at rest at a pose, without disturbance.
    pub fn new(airframe: Airframe, settings: ObserverSettings, world_from_body: &Isometry3<f64>) -> Self {
        let zero = Vector3::zeros();
        let (roll, pitch, yaw) = world_from_body.rotation.euler_angles();
        let estimate = Estimate {
            position: world_from_body.translation.vector.into(),
            velocity: zero,
            disturbance: zero,
            attitude: [roll, pitch, yaw],
            yaw_rate: 0.0,
        };
        Self {
            airframe,
            settings,
            estimate,
            command: Command { thrust: airframe.mass * GRAVITY, ..Command::default() },
            innovation: 0.0,
        }
    }

    /// The current estimate.
    pub fn estimate(&self) -> &Estimate {
        &self.estimate
    }

    /// Largest distance of a measured position from the expected one, m, forgotten as fast as the estimate forgets it: after a jump of the
    /// localisation velocity and disturbance are not what they seem.
    pub fn innovation(&self) -> f64 {
        self.innovation
    }

    /// The command that the vehicle follows from now on.
    pub fn set_command(&mut self, command: Command) {
        self.command = command;
    }

    /// Lets `dt` seconds pass and takes in a measured pose.
    pub fn update(&mut self, measured: &Isometry3<f64>, dt: f64) {
        let mut next = self.after(dt);
        // Discrete gains of the pole exp(-w dt), repeated: exact for the model position-velocity-disturbance.
        let z = (-self.settings.translation * dt).exp();
        let innovation = Point3::from(measured.translation.vector) - next.position;
        self.innovation = innovation.norm().max(z * self.innovation);
        next.position += (1.0 - z * z * z) * innovation;
        next.velocity += 1.5 * (1.0 - z) * (1.0 - z) * (1.0 + z) / dt * innovation;
        next.disturbance += (1.0 - z).powi(3) / (dt * dt) * innovation;

        let z = (-self.settings.attitude * dt).exp();
        let (roll, pitch, yaw) = measured.rotation.euler_angles();
        next.attitude[0] += (1.0 - z) * wrap(roll - next.attitude[0]);
        next.attitude[1] += (1.0 - z) * wrap(pitch - next.attitude[1]);
        let turn = wrap(yaw - next.attitude[2]);
        next.attitude[2] += (1.0 - z * z) * turn;
        next.yaw_rate += (1.0 - z) * (1.0 - z) / dt * turn;
        self.estimate = next;
    }

    /// Lets `dt` seconds pass without a pose.
    pub fn coast(&mut self, dt: f64) {
        self.estimate = self.after(dt);
    }

    /// The pose that the model expects `horizon` seconds from now under the present command.
    pub fn predict(&self, horizon: f64) -> Isometry3<f64> {
        let next = self.after(horizon);
        let [roll, pitch, yaw] = next.attitude;
        Isometry3::from_parts(Translation3::from(next.position), UnitQuaternion::from_euler_angles(roll, pitch, yaw))
    }

    /// The estimate moved by the model; the forces are taken in the middle of the interval.
    fn after(&self, dt: f64) -> Estimate {
        let now = &self.estimate;
        let middle = self.airframe.attitude_after(now.attitude, now.yaw_rate, &self.command, 0.5 * dt);
        let rotation = UnitQuaternion::from_euler_angles(middle[0], middle[1], middle[2]);
        let thrust = rotation * Vector3::new(0.0, 0.0, self.command.thrust / self.airframe.mass);
        let acceleration = thrust - Vector3::new(0.0, 0.0, GRAVITY)
            + self.airframe.drag_acceleration(&rotation, &now.velocity)
            + now.disturbance;
        Estimate {
            position: now.position + now.velocity * dt + acceleration * (0.5 * dt * dt),
            velocity: now.velocity + acceleration * dt,
            disturbance: now.disturbance,
            attitude: self.airframe.attitude_after(now.attitude, now.yaw_rate, &self.command, dt),
            yaw_rate: self.airframe.yaw_rate_after(now.yaw_rate, self.command.yaw_rate, dt),
        }
    }
}

impl Estimate {
    /// The same state as a vehicle, without acceleration.
    pub fn as_vehicle(&self) -> Vehicle {
        Vehicle {
            position: self.position,
            velocity: self.velocity,
            attitude: self.attitude,
            yaw_rate: self.yaw_rate,
            acceleration: Vector3::zeros(),
        }
    }
}

/// The same angle in -pi..=pi.
pub(super) fn wrap(angle: f64) -> f64 {
    let turn = std::f64::consts::TAU;
    angle - turn * (angle / turn).round()
}
