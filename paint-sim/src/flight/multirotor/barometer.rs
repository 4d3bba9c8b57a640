//! A barometer with noise of its own for each seed.

use crate::error::{Error, check_not_negative};
use crate::rng::Rng;

/// Noise and place of a barometer.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct BarometerSettings {
    /// White noise of a reading, Pa. Default 1 (8 cm).
    pub noise: f64,
    /// Height of the world's origin above the sea, m. Default 400.
    pub origin_height: f64,
}

impl Default for BarometerSettings {
    fn default() -> Self {
        Self { noise: 1.0, origin_height: 400.0 }
    }
}

/// What a barometer says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BarometerReading {
    /// Pressure, Pa.
    pub pressure: f64,
    /// Height above the sea in the standard atmosphere, m.
    pub height: f64,
    /// Temperature of the standard atmosphere there, degrees Celsius.
    pub temperature: f64,
}

/// A barometer in the international standard atmosphere (ISO 2533): `p = p0 (1 - L h / T0)^5.25588`.
#[derive(Debug, Clone)]
pub struct Barometer {
    settings: BarometerSettings,
    rng: Rng,
}

const SEA_PRESSURE: f64 = 101_325.0;
/// Lapse rate over the temperature at sea level, 1/m.
const LAPSE: f64 = 0.0065 / 288.15;
const EXPONENT: f64 = 5.25588;

impl Barometer {
    /// A barometer with noise of its own for each seed.
    ///
    /// # Errors
    /// Noise that is negative.
    pub fn new(settings: BarometerSettings, seed: u64) -> Result<Self, Error> {
        check_not_negative("barometer.noise", settings.noise)?;
        Ok(Self { settings, rng: Rng::new(seed, 32) })
    }

    /// The reading at a height in the world, m.
    pub fn measure(&mut self, height: f64) -> BarometerReading {
        let above_sea = self.settings.origin_height + height;
        let pressure =
            SEA_PRESSURE * (1.0 - LAPSE * above_sea).powf(EXPONENT) + self.settings.noise * self.rng.normal();
        let height = (1.0 - (pressure / SEA_PRESSURE).powf(1.0 / EXPONENT)) / LAPSE;
        BarometerReading { pressure, height, temperature: 15.0 - 0.0065 * above_sea }
    }
}
