//! A satellite receiver with noise of its own for each seed.

use nalgebra::{Point3, Vector3};

use crate::error::{Error, check_not_negative};
use crate::rng::Rng;

/// Where on Earth the world's origin is; its x points east, y north.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct GeodeticOrigin {
    /// Latitude, degrees.
    pub latitude: f64,
    /// Longitude, degrees.
    pub longitude: f64,
    /// Height above the sea, m.
    pub height: f64,
}

impl Default for GeodeticOrigin {
    /// Zurich.
    fn default() -> Self {
        Self { latitude: 47.3977, longitude: 8.5456, height: 400.0 }
    }
}

/// Noise of a satellite receiver.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct GpsSettings {
    /// Where the world lies.
    pub origin: GeodeticOrigin,
    /// White noise of the horizontal position, m. Default 0.5.
    pub horizontal_noise: f64,
    /// White noise of the height, m. Default 1.
    pub vertical_noise: f64,
    /// White noise of each component of the velocity, m/s. Default 0.1.
    pub velocity_noise: f64,
}

impl Default for GpsSettings {
    fn default() -> Self {
        let origin = GeodeticOrigin::default();
        Self { origin, horizontal_noise: 0.5, vertical_noise: 1.0, velocity_noise: 0.1 }
    }
}

/// What a satellite receiver says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GpsReading {
    /// Place on Earth.
    pub place: GeodeticOrigin,
    /// Velocity, world frame, m/s.
    pub velocity: Vector3<f64>,
}

/// A satellite receiver on a sphere of 6,371 km: for the metres of a flight.
#[derive(Debug, Clone)]
pub struct Gps {
    settings: GpsSettings,
    rng: Rng,
}

impl Gps {
    /// A receiver with noise of its own for each seed.
    ///
    /// # Errors
    /// Noise that is negative, or a latitude within a degree of a pole.
    pub fn new(settings: GpsSettings, seed: u64) -> Result<Self, Error> {
        check_not_negative("gps.horizontal_noise", settings.horizontal_noise)?;
        check_not_negative("gps.vertical_noise", settings.vertical_noise)?;
        check_not_negative("gps.velocity_noise", settings.velocity_noise)?;
        let latitude = settings.origin.latitude;
        if latitude.abs() <= 89.0 {
            Ok(Self { settings, rng: Rng::new(seed, 34) })
        } else {
            Err(Error::OutOfRange {
                what: "gps.origin.latitude",
                value: latitude,
                allowed: "between -89 and 89 degrees",
            })
        }
    }

    /// The reading of a body that moves in the world.
    pub fn measure(&mut self, position: &Point3<f64>, velocity: &Vector3<f64>) -> GpsReading {
        let GpsSettings { origin, horizontal_noise, vertical_noise, velocity_noise } = self.settings;
        let sigma = Vector3::new(horizontal_noise, horizontal_noise, vertical_noise);
        let at = position.coords + self.rng.normal3().component_mul(&sigma);
        let degrees = |metres: f64| (metres / 6_371_000.0).to_degrees();
        let place = GeodeticOrigin {
            latitude: origin.latitude + degrees(at.y),
            longitude: origin.longitude + degrees(at.x) / origin.latitude.to_radians().cos(),
            height: origin.height + at.z,
        };
        GpsReading { place, velocity: velocity + self.rng.normal3() * velocity_noise }
    }
}
