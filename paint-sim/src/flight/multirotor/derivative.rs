//! The equations of motion.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::settings::MultirotorSettings;
use super::surroundings::Surroundings;
use crate::flight::airframe::GRAVITY;

/// Position and velocity in the world, attitude from body to world, angular velocity in the body; or their rates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Motion {
    pub(super) position: Vector3<f64>,
    pub(super) velocity: Vector3<f64>,
    pub(super) attitude: Quaternion<f64>,
    pub(super) rate: Vector3<f64>,
}

impl Motion {
    pub(super) fn moved(&self, rates: &Self, dt: f64) -> Self {
        Self {
            position: self.position + rates.position * dt,
            velocity: self.velocity + rates.velocity * dt,
            attitude: self.attitude + rates.attitude * dt,
            rate: self.rate + rates.rate * dt,
        }
    }

    pub(super) fn normalised(self) -> Self {
        Self { attitude: self.attitude.normalize(), ..self }
    }

    pub(super) fn is_finite(&self) -> bool {
        let vectors = [self.position, self.velocity, self.rate];
        vectors.iter().flatten().chain(self.attitude.coords.iter()).all(|v| v.is_finite())
    }

    /// The rates of this state. `motors`: where each motor is.
    pub(super) fn derivative(
        &self,
        settings: &MultirotorSettings,
        motors: impl Iterator<Item = f64>,
        mass: f64,
        surroundings: &Surroundings,
    ) -> Self {
        let world_from_body = UnitQuaternion::new_normalize(self.attitude);
        let inertia = Vector3::from(settings.inertia);

        let through_air = world_from_body.inverse_transform_vector(&(self.velocity - surroundings.wind));
        let mut force = -through_air.component_mul(&Vector3::from(settings.rotor_drag))
            - settings.body_drag * through_air.norm() * through_air;
        let mut torque = -self.rate.cross(&inertia.component_mul(&self.rate));
        for (rotor, motor) in settings.rotors.iter().zip(motors) {
            let thrust = Vector3::z() * (rotor.max_thrust * settings.thrust_of(motor));
            force += thrust;
            torque += rotor.position.coords.cross(&thrust) - rotor.spin * rotor.moment * thrust;
        }
        for load in surroundings.loads {
            let in_body = world_from_body.inverse_transform_vector(&load.force);
            force += in_body;
            torque += load.point.coords.cross(&in_body);
        }
        Self {
            position: self.velocity,
            velocity: world_from_body * force / mass - Vector3::z() * GRAVITY,
            attitude: quaternion_rate(&self.attitude, &self.rate),
            rate: torque.component_div(&inertia),
        }
    }
}

/// The quaternion's derivative `1/2 q (0, w)`.
fn quaternion_rate(attitude: &Quaternion<f64>, rate: &Vector3<f64>) -> Quaternion<f64> {
    attitude * Quaternion::from_imag(*rate) * 0.5
}
