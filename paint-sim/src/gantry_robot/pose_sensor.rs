//! The camera that tracks markers beside the object: noisy poses, and none while it loses them.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use crate::error::{Error, check_not_negative, check_range};
use crate::rng::Rng;

/// Noise and gaps of the tracking.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct PoseSensorSettings {
    /// Standard deviation of each coordinate of a pose, white, m (default 2 mm).
    pub position_sigma: f64,
    /// Standard deviation of each component of its rotation vector, rad (default 0.2 degrees).
    pub rotation_sigma: f64,
    /// Losses of the markers per second (default 0.05).
    pub loss_rate: f64,
    /// Mean duration of a loss, s (default 0.3).
    pub loss_duration: f64,
}

impl Default for PoseSensorSettings {
    fn default() -> Self {
        Self { position_sigma: 2e-3, rotation_sigma: 0.2_f64.to_radians(), loss_rate: 0.05, loss_duration: 0.3 }
    }
}

/// A tracked robot.
#[derive(Debug, Clone)]
pub struct PoseSensor {
    settings: PoseSensorSettings,
    noise: Rng,
    gaps: Rng,
    lost_until: f64,
}

impl PoseSensor {
    /// With noise of its own for each seed.
    ///
    /// # Errors
    /// Numbers that are negative.
    pub fn new(settings: PoseSensorSettings, seed: u64) -> Result<Self, Error> {
        check_not_negative("pose_sensor.position_sigma", settings.position_sigma)?;
        check_not_negative("pose_sensor.rotation_sigma", settings.rotation_sigma)?;
        check_range("pose_sensor.loss_rate", settings.loss_rate, 0.0, 1e3, "between 0 and 1000 per second")?;
        check_not_negative("pose_sensor.loss_duration", settings.loss_duration)?;
        let (noise, gaps) = (Rng::new(seed, 21), Rng::new(seed, 22));
        Ok(Self { settings, noise, gaps, lost_until: f64::NEG_INFINITY })
    }

    /// The pose measured at `time` (s), `dt` after the one before; `None` while the markers are lost.
    pub fn measure(&mut self, world_from_robot: &Isometry3<f64>, time: f64, dt: f64) -> Option<Isometry3<f64>> {
        let Self { settings, noise, gaps, lost_until } = self;
        // Both streams advance at every call, so that neither depends on the other.
        let (chance, length) = (gaps.uniform(), -(-gaps.uniform()).ln_1p() * settings.loss_duration);
        let mut white = |sigma: f64| Vector3::from_fn(|_, _| noise.normal()) * sigma;
        let (shift, turn) = (white(settings.position_sigma), white(settings.rotation_sigma));
        if time >= *lost_until && chance < settings.loss_rate * dt {
            *lost_until = time + length;
        }
        if time < *lost_until {
            return None;
        }
        let position = Translation3::from(world_from_robot.translation.vector + shift);
        Some(Isometry3::from_parts(position, UnitQuaternion::from_scaled_axis(turn) * world_from_robot.rotation))
    }
}
