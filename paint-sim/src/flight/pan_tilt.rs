//! The pan-tilt unit that points the nozzle.

use nalgebra::{Isometry3, Point3, UnitVector3, Vector3};

use crate::error::{Error, check_not_negative, check_range};

/// A nozzle on two servos. Body frame: x forward, y left, z up. Angles are (pan, tilt) in the unit's own convention.
pub trait PanTilt {
    /// The angles that let the spray hit `aim` from the pose `world_from_body`, moved into the limits of the unit.
    fn command(&self, world_from_body: &Isometry3<f64>, aim: &Point3<f64>) -> [f64; 2];

    /// Puts the unit at rest at these angles.
    fn reset(&mut self, angles: [f64; 2]);

    /// Gives a command, lets `dt` seconds pass and returns the angles.
    fn step(&mut self, command: [f64; 2], dt: f64) -> [f64; 2];

    /// Tip of the nozzle and spray direction in the world.
    fn nozzle(&self, world_from_body: &Isometry3<f64>, angles: [f64; 2]) -> (Point3<f64>, UnitVector3<f64>);

    /// Time from a command to its effect, s: the loop predicts the pose of the body and the aim for it.
    fn delay(&self) -> f64;
}

/// The simplest pan-tilt unit: both axes and the spray meet in one point of the body, and the joints follow their commands
/// at once.
///
/// Pan turns to the left (about z), then tilt turns upwards. A unit with servos is an implementation of [`PanTilt`] around
/// a servo model.
#[derive(Debug, Clone)]
pub struct IdealPanTilt {
    pivot_in_body: Point3<f64>,
    nozzle_length: f64,
    limits: [f64; 2],
}

impl IdealPanTilt {
    /// A unit whose axes meet at `pivot_in_body`, with the nozzle's tip `nozzle_length` metres before it and symmetric
    /// limits (pan, tilt) in rad.
    ///
    /// # Errors
    /// Numbers that are not finite, a length that is negative, or limits outside 0..pi.
    pub fn new(pivot_in_body: Point3<f64>, nozzle_length: f64, limits: [f64; 2]) -> Result<Self, Error> {
        if !pivot_in_body.iter().all(|v| v.is_finite()) {
            return Err(Error::NotFinite { what: "pivot of the pan-tilt unit", index: 0 });
        }
        check_not_negative("nozzle length", nozzle_length)?;
        for limit in limits {
            check_range("limit of the pan-tilt unit", limit, 0.0, std::f64::consts::PI, "between 0 and pi")?;
        }
        Ok(Self { pivot_in_body, nozzle_length, limits })
    }
}

impl Default for IdealPanTilt {
    /// A unit like `PaintCopter`'s: pivot 0.6 m before the body's centre, tip 0.1 m further, +-90 and +-45 degrees.
    fn default() -> Self {
        let limits = [90.0_f64.to_radians(), 45.0_f64.to_radians()];
        Self { pivot_in_body: Point3::new(0.6, 0.0, 0.0), nozzle_length: 0.1, limits }
    }
}

impl PanTilt for IdealPanTilt {
    fn command(&self, world_from_body: &Isometry3<f64>, aim: &Point3<f64>) -> [f64; 2] {
        let ray = world_from_body.inverse_transform_point(aim) - self.pivot_in_body;
        let [pan, tilt] = [ray.y.atan2(ray.x), ray.z.atan2(ray.x.hypot(ray.y))];
        [pan.clamp(-self.limits[0], self.limits[0]), tilt.clamp(-self.limits[1], self.limits[1])]
    }

    fn reset(&mut self, _: [f64; 2]) {}

    fn step(&mut self, command: [f64; 2], _: f64) -> [f64; 2] {
        command
    }

    fn nozzle(&self, world_from_body: &Isometry3<f64>, [pan, tilt]: [f64; 2]) -> (Point3<f64>, UnitVector3<f64>) {
        let axis = Vector3::new(tilt.cos() * pan.cos(), tilt.cos() * pan.sin(), tilt.sin());
        let tip = self.pivot_in_body + axis * self.nozzle_length;
        (world_from_body * tip, UnitVector3::new_normalize(world_from_body * axis))
    }

    fn delay(&self) -> f64 {
        0.0
    }
}
