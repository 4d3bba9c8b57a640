//! What the controller knows of the vehicle, and what it says to it.

use nalgebra::{Point3, Vector3};

use crate::error::Error;

/// How one angle of the attitude follows its command: `tau x' = K u - x` (Paper II, section 5.2).
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct AttitudeResponse {
    /// Gain `K`.
    pub gain: f64,
    /// Time constant `tau`, s.
    pub time_constant: f64,
}

/// What the controller knows of the vehicle.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct VehicleModel {
    /// Response of roll. Default 1.017, 0.1847 s (the small multirotor published with the ETH model predictive controller).
    pub roll: AttitudeResponse,
    /// Response of pitch. Default 0.789, 0.175 s (same source).
    pub pitch: AttitudeResponse,
    /// Linear drag per mass, horizontal and vertical, 1/s. Default 0.3, 0.1.
    pub drag: [f64; 2],
    /// Largest roll or pitch that is commanded, rad. Default 25 degrees (same source as the gains).
    pub tilt_limit: f64,
    /// Least and greatest thrust per mass, m/s². Default 2 and 20.
    pub thrust: [f64; 2],
}

impl Default for VehicleModel {
    fn default() -> Self {
        Self {
            roll: AttitudeResponse { gain: 1.017, time_constant: 0.1847 },
            pitch: AttitudeResponse { gain: 0.789, time_constant: 0.175 },
            drag: [0.3, 0.1],
            tilt_limit: 25.0_f64.to_radians(),
            thrust: [2.0, 20.0],
        }
    }
}

impl VehicleModel {
    pub(crate) fn check(&self) -> Result<(), Error> {
        let positive = [
            ("vehicle.roll.gain", self.roll.gain),
            ("vehicle.roll.time_constant", self.roll.time_constant),
            ("vehicle.pitch.gain", self.pitch.gain),
            ("vehicle.pitch.time_constant", self.pitch.time_constant),
            ("vehicle.thrust[0]", self.thrust[0]),
        ];
        for (name, value) in positive {
            if !(value.is_finite() && value > 0.0) {
                return Err(Error::Setting { name, value, requirement: "positive" });
            }
        }
        for (name, value) in [("vehicle.drag[0]", self.drag[0]), ("vehicle.drag[1]", self.drag[1])] {
            if !(value.is_finite() && value >= 0.0) {
                return Err(Error::Setting { name, value, requirement: "at least 0" });
            }
        }
        if !(0.01..=1.2).contains(&self.tilt_limit) {
            return Err(Error::Setting {
                name: "vehicle.tilt_limit",
                value: self.tilt_limit,
                requirement: "between 0.01 and 1.2 rad",
            });
        }
        if !(self.thrust[1].is_finite() && self.thrust[1] > self.thrust[0]) {
            return Err(Error::Setting {
                name: "vehicle.thrust[1]",
                value: self.thrust[1],
                requirement: "greater than the least thrust",
            });
        }
        Ok(())
    }
}

/// The vehicle as an estimator sees it. World frame, z up, SI units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ControlState {
    /// Centre of the body, m.
    pub position: Point3<f64>,
    /// Its velocity, m/s.
    pub velocity: Vector3<f64>,
    /// Roll, pitch and yaw, `R = Rz(yaw) Ry(pitch) Rx(roll)`, rad.
    pub attitude: [f64; 3],
    /// Acceleration that the model does not explain: wind, hose, m/s². Taken as constant over the horizon.
    pub disturbance: Vector3<f64>,
}

/// The wanted state at one moment. World frame, SI units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ControlReference {
    /// Centre of the level body, m.
    pub position: Point3<f64>,
    /// Its velocity, m/s.
    pub velocity: Vector3<f64>,
    /// Its acceleration, m/s².
    pub acceleration: Vector3<f64>,
    /// Heading, rad.
    pub heading: f64,
    /// Its rate, rad/s.
    pub heading_rate: f64,
    /// From the centre of the level body to the point that shall keep its place when the body tilts, m.
    pub lever: Vector3<f64>,
}

/// What the attitude loop is asked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ControlCommand {
    /// Roll, rad.
    pub roll: f64,
    /// Pitch, rad.
    pub pitch: f64,
    /// Yaw rate, rad/s.
    pub yaw_rate: f64,
    /// Thrust per mass along the body's z axis, m/s².
    pub thrust: f64,
}
