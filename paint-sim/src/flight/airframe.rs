//! Mass and responses of the multirotor: first-order attitude, linear rotor drag.

use nalgebra::{UnitQuaternion, Vector3};

use crate::error::{Error, check_not_negative, check_positive, check_range};

/// Standard gravity, m/s^2.
pub const GRAVITY: f64 = 9.80665;

/// What the controller asks of the attitude loop.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Command {
    /// Roll (about the body's x axis), rad.
    pub roll: f64,
    /// Pitch (about the body's y axis, positive lets the body accelerate forward), rad.
    pub pitch: f64,
    /// Yaw rate, rad/s.
    pub yaw_rate: f64,
    /// Thrust along the body's z axis, N.
    pub thrust: f64,
}

/// Mass and responses of the vehicle.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct Airframe {
    /// Mass with arm and spray gun, kg. Default 4.2 (Paper II, section 3.1: a modified DJI Matrice 100, 4200 g in all).
    pub mass: f64,
    /// Gain from the roll command to roll. Default 1.017 (the small multirotor published with the ETH model predictive controller).
    pub roll_gain: f64,
    /// Time constant of roll, s. Default 0.1847 (same source).
    pub roll_time_constant: f64,
    /// Gain from the pitch command to pitch. Default 0.789 (same source).
    pub pitch_gain: f64,
    /// Time constant of pitch, s. Default 0.175 (same source).
    pub pitch_time_constant: f64,
    /// Time constant of the yaw rate, s. Default 0.15.
    pub yaw_time_constant: f64,
    /// Linear drag per mass along the body's axes, 1/s. Default 0.3, 0.3, 0.1.
    pub drag: [f64; 3],
    /// Largest commanded roll or pitch, rad. Default 25 degrees (same source as the gains).
    pub tilt_limit: f64,
}

impl Default for Airframe {
    fn default() -> Self {
        Self {
            mass: 4.2,
            roll_gain: 1.017,
            roll_time_constant: 0.1847,
            pitch_gain: 0.789,
            pitch_time_constant: 0.175,
            yaw_time_constant: 0.15,
            drag: [0.3, 0.3, 0.1],
            tilt_limit: 25.0_f64.to_radians(),
        }
    }
}

impl Airframe {
    pub(super) fn check(&self) -> Result<(), Error> {
        for (what, value) in [
            ("airframe.mass", self.mass),
            ("airframe.roll_gain", self.roll_gain),
            ("airframe.roll_time_constant", self.roll_time_constant),
            ("airframe.pitch_gain", self.pitch_gain),
            ("airframe.pitch_time_constant", self.pitch_time_constant),
            ("airframe.yaw_time_constant", self.yaw_time_constant),
        ] {
            check_positive(what, value)?;
        }
        self.drag.iter().try_for_each(|drag| check_not_negative("airframe.drag", *drag))?;
        check_range("airframe.tilt_limit", self.tilt_limit, 0.01, 1.2, "between 0.01 and 1.2 rad")
    }

    /// Roll, pitch and yaw after `dt` seconds of a constant command: `tau x' = k u - x` solved exactly for roll and pitch.
    pub(crate) fn attitude_after(&self, attitude: [f64; 3], yaw_rate: f64, command: &Command, dt: f64) -> [f64; 3] {
        let follow = |x: f64, gain: f64, tau: f64, u: f64| x + (gain * u - x) * -(-dt / tau).exp_m1();
        // The exact integral of the first-order yaw rate.
        let turned = command.yaw_rate * dt
            + (yaw_rate - command.yaw_rate) * self.yaw_time_constant * -(-dt / self.yaw_time_constant).exp_m1();
        [
            follow(attitude[0], self.roll_gain, self.roll_time_constant, command.roll),
            follow(attitude[1], self.pitch_gain, self.pitch_time_constant, command.pitch),
            attitude[2] + turned,
        ]
    }

    pub(crate) fn yaw_rate_after(&self, yaw_rate: f64, command: f64, dt: f64) -> f64 {
        yaw_rate + (command - yaw_rate) * -(-dt / self.yaw_time_constant).exp_m1()
    }

    /// Acceleration by drag for a velocity relative to the air, world frame.
    pub(crate) fn drag_acceleration(&self, rotation: &UnitQuaternion<f64>, relative: &Vector3<f64>) -> Vector3<f64> {
        let in_body = rotation.inverse_transform_vector(relative);
        -(rotation * in_body.component_mul(&Vector3::from(self.drag)))
    }
}
