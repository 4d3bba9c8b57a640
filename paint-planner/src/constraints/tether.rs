//! A hose or tether that stays on its side of the vehicle.

use std::f64::consts::PI;

use nalgebra::Point3;

use crate::angle::wrap;
use crate::error::{Error, ensure};
use crate::world::VehicleState;

/// Nearer than this to the vertical through the anchor the hose hangs straight down, on no side, m.
const STRAIGHT_DOWN: f64 = 0.05;

/// A hose or tether that leaves the vehicle backwards and hangs to an anchor. The vehicle turns so that the anchor stays behind it:
/// the hose then neither winds about the vehicle nor comes between gun and surface.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Tether {
    /// Where it is held: the compressor, the winch, m, world frame.
    pub anchor: Point3<f64>,
    /// Greatest angle between the vehicle's back and the bearing of the anchor, rad.
    pub half_angle: f64,
}

impl Tether {
    /// Refuses a tether that is none.
    ///
    /// # Errors
    /// [`Error::Setting`].
    pub fn check(&self) -> Result<(), Error> {
        let sum = self.anchor.coords.sum();
        ensure("tether.anchor", sum, sum.is_finite(), "a point of finite numbers")?;
        let range = 0.0 < self.half_angle && self.half_angle <= PI;
        ensure("tether.half_angle", self.half_angle, range, "above 0 and at most pi, in radians")
    }

    /// Angle between the vehicle's back and the bearing of the anchor, rad, positive to the left; 0 where the tether hangs straight
    /// down.
    pub fn angle(&self, vehicle: &VehicleState) -> f64 {
        let way = self.anchor - vehicle.position;
        if way.x.hypot(way.y) < STRAIGHT_DOWN {
            return 0.0;
        }
        wrap(way.y.atan2(way.x) - vehicle.heading - PI)
    }

    /// Whether the anchor is behind the vehicle: what a [`Tool`](crate::Tool) on a tether answers to
    /// [`permits`](crate::Tool::permits).
    pub fn permits(&self, vehicle: &VehicleState) -> bool {
        self.angle(vehicle).abs() <= self.half_angle
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_anchor_is_behind_or_beside() {
        let tether = Tether { anchor: Point3::new(-2.0, 0.0, 0.0), half_angle: 0.5 };
        let looking =
            |heading: f64| VehicleState { position: Point3::new(0.0, 0.0, 3.0), heading, pan: 0.0, tilt: 0.0 };
        for (heading, expected) in [(0.0, 0.0), (0.4, -0.4), (-0.6, 0.6), (2.0 * PI + 0.1, -0.1), (3.0, -3.0)] {
            assert!((tether.angle(&looking(heading)) - expected).abs() < 1e-12, "{heading}");
            assert_eq!(tether.permits(&looking(heading)), expected.abs() <= 0.5);
        }
        let above = VehicleState { position: Point3::new(-2.0, 0.01, 3.0), ..looking(3.0) };
        assert!(tether.permits(&above));
    }
}
