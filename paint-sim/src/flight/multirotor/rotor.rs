//! Rotors and where they sit.

use nalgebra::{Matrix4xX, Point3};

use crate::error::{Error, check_not_negative, check_positive};

/// A rotor whose axis is the body's z.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Rotor {
    /// Its hub from the centre of mass, body frame, m.
    pub position: Point3<f64>,
    /// 1 where it turns counter-clockwise seen from above, -1 clockwise.
    pub spin: f64,
    /// Thrust at full command, N.
    pub max_thrust: f64,
    /// Torque about its axis per thrust, m.
    pub moment: f64,
    /// Time constant of the first-order lag from command to speed, s.
    pub time_constant: f64,
}

impl Rotor {
    pub(super) fn check(&self) -> Result<(), Error> {
        if !self.position.iter().all(|v| v.is_finite()) {
            return Err(Error::NotFinite { what: "position of a rotor", index: 0 });
        }
        if self.spin.abs() != 1.0 {
            return Err(Error::OutOfRange { what: "spin of a rotor", value: self.spin, allowed: "1 or -1" });
        }
        check_positive("max_thrust of a rotor", self.max_thrust)?;
        check_not_negative("moment of a rotor", self.moment)?;
        check_positive("time_constant of a rotor", self.time_constant)
    }
}

/// Whether thrust and three torques can be set one by one: the columns (thrust, torques) of the rotors span four dimensions.
pub(super) fn controllable(rotors: &[Rotor]) -> bool {
    let column = |r: &Rotor| [1.0, r.position.y, -r.position.x, -r.spin * r.moment];
    let columns: Vec<f64> = rotors.iter().flat_map(column).collect();
    Matrix4xX::from_column_slice(&columns).svd(false, false).rank(1e-9) == 4
}

/// Four rotors `arm` metres from the centre at 45 degrees, in PX4's order: front right, rear left (both counter-clockwise), front
/// left, rear right.
pub fn quadrotor_x(arm: f64, rotor: Rotor) -> Vec<Rotor> {
    around(arm, rotor, &[(-45.0, 1.0), (135.0, 1.0), (45.0, -1.0), (-135.0, -1.0)])
}

/// Six rotors `arm` metres from the centre, 60 degrees apart, in PX4's order: right (clockwise), left, front left (clockwise), rear
/// right, front right, rear left (clockwise).
pub fn hexarotor_x(arm: f64, rotor: Rotor) -> Vec<Rotor> {
    around(arm, rotor, &[(-90.0, -1.0), (90.0, 1.0), (30.0, -1.0), (-150.0, 1.0), (-30.0, 1.0), (150.0, -1.0)])
}

/// Rotors at angles from the body's x axis to its left, degrees, each with its spin.
fn around(arm: f64, rotor: Rotor, places: &[(f64, f64)]) -> Vec<Rotor> {
    let place = |&(degrees, spin): &(f64, f64)| {
        let (sin, cos) = degrees.to_radians().sin_cos();
        Rotor { position: Point3::new(arm * cos, arm * sin, rotor.position.z), spin, ..rotor }
    };
    places.iter().map(place).collect()
}
