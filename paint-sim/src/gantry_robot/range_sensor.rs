//! A few beams that measure the distance to the object.

use nalgebra::{Isometry3, Point3, UnitVector3, Vector3};

use crate::error::{Error, check_not_negative, check_range};
use crate::rng::Rng;
use crate::surface::Surface;

/// Beams of the sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct RangeSensorSettings {
    /// Beams per reading, in a cross of two fans (default 10).
    pub beams: usize,
    /// Half opening of the fans, rad (default 25 degrees).
    pub half_angle: f64,
    /// Standard deviation of a distance, m (default 1 mm).
    pub sigma: f64,
    /// Longest distance, m (default 0.3).
    pub range: f64,
}

impl Default for RangeSensorSettings {
    fn default() -> Self {
        Self { beams: 10, half_angle: 25.0_f64.to_radians(), sigma: 1e-3, range: 0.3 }
    }
}

/// A range sensor at the robot's origin that looks along its x axis.
#[derive(Debug, Clone)]
pub struct RangeSensor {
    settings: RangeSensorSettings,
    noise: Rng,
    /// In the robot's frame.
    directions: Vec<UnitVector3<f64>>,
}

impl RangeSensor {
    /// With noise of its own for each seed.
    ///
    /// # Errors
    /// Numbers out of range.
    pub fn new(settings: RangeSensorSettings, seed: u64) -> Result<Self, Error> {
        check_range("range_sensor.beams", settings.beams as f64, 0.0, 1000.0, "at most 1000")?;
        check_range("range_sensor.half_angle", settings.half_angle, 0.0, 1.4, "between 0 and 1.4 rad")?;
        check_not_negative("range_sensor.sigma", settings.sigma)?;
        check_not_negative("range_sensor.range", settings.range)?;
        let directions = (0..settings.beams)
            .map(|k| {
                let fan = (settings.beams / 2).max(1) as f64;
                let angle = settings.half_angle * (2.0 * ((k / 2) as f64 + 0.5) / fan - 1.0);
                let slope = angle.tan();
                let sideways = if k % 2 == 0 { Vector3::y() } else { Vector3::z() };
                UnitVector3::new_normalize(Vector3::x() + sideways * slope)
            })
            .collect();
        Ok(Self { settings, noise: Rng::new(seed, 23), directions })
    }

    /// Beam directions in the robot's frame.
    pub fn directions(&self) -> &[UnitVector3<f64>] {
        &self.directions
    }

    /// Distances along the beams of a robot, m; `None` where nothing is in range.
    pub fn measure(&mut self, world_from_robot: &Isometry3<f64>, surface: &dyn Surface) -> Vec<Option<f64>> {
        let Self { settings, noise, directions } = self;
        let origin = world_from_robot * Point3::origin();
        directions
            .iter()
            .map(|direction| {
                let error = noise.normal() * settings.sigma;
                let hit =
                    surface.cast(&origin, &(world_from_robot.rotation * direction.into_inner()), settings.range)?;
                Some((hit.distance + error).max(0.0))
            })
            .collect()
    }
}
