//! The constants of a multirotor.

use nalgebra::Point3;

use super::rotor::{Rotor, controllable, hexarotor_x, quadrotor_x};
use crate::error::{Error, check_not_negative, check_positive, check_range};

/// Mass, inertia, rotors and drag. The defaults are ours, chosen to go with [`Airframe`](crate::flight::Airframe): no paper prints
/// them for the robot.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct MultirotorSettings {
    /// Mass without paint, kg. Default 4.2.
    pub mass: f64,
    /// Principal moments of inertia about the body's axes, kg m^2. Default 0.08, 0.08, 0.14.
    pub inertia: [f64; 3],
    /// The rotors. Default four of 21 N on arms of 0.35 m.
    pub rotors: Vec<Rotor>,
    /// Share `k` of the square in the thrust curve `k x^2 + (1 - k) x`. Default 0: the speed controller is linear in thrust.
    pub thrust_curve: f64,
    /// Linear drag of the rotors along the body's axes, N s/m. Default 1.26, 1.26, 0.42: 0.3, 0.3 and 0.1 per second.
    pub rotor_drag: [f64; 3],
    /// Quadratic drag of the body, N s^2/m^2. Default 0.02.
    pub body_drag: f64,
    /// Paint on board at the start, kg. Default 0: it comes through the hose.
    pub paint: f64,
}

/// A rotor of the default vehicle. Its lag of 30 ms is the middle of what is published for motors of this size (20 to 50 ms).
const ROTOR: Rotor =
    Rotor { position: Point3::new(0.0, 0.0, 0.0), spin: 1.0, max_thrust: 21.0, moment: 0.02, time_constant: 0.03 };

impl Default for MultirotorSettings {
    fn default() -> Self {
        Self {
            mass: 4.2,
            inertia: [0.08, 0.08, 0.14],
            rotors: quadrotor_x(0.35, ROTOR),
            thrust_curve: 0.0,
            rotor_drag: [1.26, 1.26, 0.42],
            body_drag: 0.02,
            paint: 0.0,
        }
    }
}

impl MultirotorSettings {
    /// The default vehicle with six rotors of the same thrust together.
    pub fn hexarotor() -> Self {
        let rotor = Rotor { max_thrust: ROTOR.max_thrust * 4.0 / 6.0, ..ROTOR };
        Self { rotors: hexarotor_x(0.35, rotor), ..Self::default() }
    }

    /// Share of the full thrust at a motor state of 0 to 1.
    pub fn thrust_of(&self, motor: f64) -> f64 {
        motor * (self.thrust_curve * motor + (1.0 - self.thrust_curve))
    }

    /// The command that brings this share of the full thrust: the inverse of [`MultirotorSettings::thrust_of`].
    pub fn command_for(&self, thrust: f64) -> f64 {
        let (k, linear) = (self.thrust_curve, 1.0 - self.thrust_curve);
        // Citardauq's form of the root: right for k = 0 as well.
        2.0 * thrust / (linear + (linear * linear + 4.0 * k * thrust).sqrt())
    }

    pub(super) fn check(&self) -> Result<(), Error> {
        check_positive("multirotor.mass", self.mass)?;
        for moment in self.inertia {
            check_positive("multirotor.inertia", moment)?;
        }
        let [x, y, z] = self.inertia;
        let most = x.max(y).max(z);
        // Of a solid body two moments are never less than the third.
        check_range("multirotor.inertia", most, 0.0, x + y + z - most, "at most the sum of the two other moments")?;
        for drag in self.rotor_drag {
            check_not_negative("multirotor.rotor_drag", drag)?;
        }
        check_not_negative("multirotor.body_drag", self.body_drag)?;
        check_not_negative("multirotor.paint", self.paint)?;
        check_range("multirotor.thrust_curve", self.thrust_curve, 0.0, 1.0, "between 0 and 1")?;
        self.rotors.iter().try_for_each(Rotor::check)?;
        if controllable(&self.rotors) { Ok(()) } else { Err(Error::Uncontrollable { rotors: self.rotors.len() }) }
    }
}
