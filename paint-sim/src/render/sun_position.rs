//! Where the sun stands.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use nalgebra::{UnitVector3, Vector3};

use crate::error::{Error, check_range};

/// Seconds from the Unix epoch to noon of 2000-01-01, from which the almanac counts days.
const J2000: f64 = 946_728_000.0;
/// The first and last second of 1950 to 2050, for which the formulas are good to 0.01 degrees.
const ALMANAC: [f64; 2] = [-631_152_000.0, 2_556_143_999.0];

/// Where the sun is seen, without the refraction of the air (0.5 degrees at the horizon).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SunPosition {
    /// Clockwise from north, radians, 0..2π.
    pub azimuth: f64,
    /// Above the horizon, radians; negative at night.
    pub elevation: f64,
}

impl SunPosition {
    /// At a time (seconds since 1970-01-01 00:00 UTC) and a place (radians, north and east positive): the low-precision formulas of the
    /// Astronomical Almanac, as in Michalsky 1988.
    ///
    /// # Errors
    /// Times outside of 1950 to 2050, a latitude beyond a pole, a longitude beyond ±2π.
    pub fn new(unix_time: f64, latitude: f64, longitude: f64) -> Result<Self, Error> {
        check_range("time of the sun", unix_time, ALMANAC[0], ALMANAC[1], "from 1950 to 2050, seconds since 1970")?;
        check_range("latitude", latitude, -FRAC_PI_2, FRAC_PI_2, "from -pi/2 to pi/2")?;
        check_range("longitude", longitude, -TAU, TAU, "from -2 pi to 2 pi")?;
        let days = (unix_time - J2000) / 86_400.0;
        let mean_longitude = (280.460 + 0.985_647_4 * days).to_radians();
        let anomaly = (357.528 + 0.985_600_3 * days).to_radians();
        let centre = (1.915 * anomaly.sin() + 0.020 * (2.0 * anomaly).sin()).to_radians();
        let ecliptic_longitude = mean_longitude + centre;
        let obliquity = (23.439 - 4e-7 * days).to_radians();
        let (sine, cosine) = ecliptic_longitude.sin_cos();
        let right_ascension = (obliquity.cos() * sine).atan2(cosine);
        let declination = (obliquity.sin() * sine).asin();
        // Greenwich mean sidereal time, hours to radians.
        let sidereal = (18.697_374_558 + 24.065_709_824_419_08 * days).rem_euclid(24.0) * PI / 12.0;
        let hour_angle = sidereal + longitude - right_ascension;
        let east = -declination.cos() * hour_angle.sin();
        let north = latitude.cos() * declination.sin() - latitude.sin() * declination.cos() * hour_angle.cos();
        let up = latitude.sin() * declination.sin() + latitude.cos() * declination.cos() * hour_angle.cos();
        Ok(Self { azimuth: east.atan2(north).rem_euclid(TAU), elevation: up.clamp(-1.0, 1.0).asin() })
    }

    /// Unit vector towards it in a frame with x east, y north, z up.
    pub fn direction(&self) -> UnitVector3<f64> {
        let (up, level) = self.elevation.sin_cos();
        let (east, north) = self.azimuth.sin_cos();
        UnitVector3::new_normalize(Vector3::new(level * east, level * north, up))
    }
}
