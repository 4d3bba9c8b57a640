//! A magnetometer with noise of its own for each seed.

use nalgebra::{UnitQuaternion, Vector3};

use crate::error::{Error, check_not_negative};
use crate::rng::Rng;

/// The field of the Earth and the noise of what measures it.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct MagnetometerSettings {
    /// The field in the world, gauss. Default that of central Europe where x points east: 0.01, 0.21, -0.43.
    pub field: Vector3<f64>,
    /// White noise of each component, gauss. Default 1e-3.
    pub noise: f64,
}

impl Default for MagnetometerSettings {
    fn default() -> Self {
        Self { field: Vector3::new(0.01, 0.21, -0.43), noise: 1e-3 }
    }
}

/// A magnetometer.
#[derive(Debug, Clone)]
pub struct Magnetometer {
    settings: MagnetometerSettings,
    rng: Rng,
}

impl Magnetometer {
    /// A magnetometer with noise of its own for each seed.
    ///
    /// # Errors
    /// Noise that is negative.
    pub fn new(settings: MagnetometerSettings, seed: u64) -> Result<Self, Error> {
        check_not_negative("magnetometer.noise", settings.noise)?;
        Ok(Self { settings, rng: Rng::new(seed, 33) })
    }

    /// The field in the body, gauss.
    pub fn measure(&mut self, rotation: &UnitQuaternion<f64>) -> Vector3<f64> {
        rotation.inverse_transform_vector(&self.settings.field) + self.rng.normal3() * self.settings.noise
    }
}
