//! The sun's light after its way through the air.

use std::f64::consts::PI;

use nalgebra::UnitVector3;

use crate::colour::{Spectrum, linear_srgb_of_emission, wavelength};
use crate::error::{Error, check_range};

/// Radiance of the sun outside of the atmosphere, 100 W/(m² sr nm) (Preetham, Shirley, Smits 1999, Table 2), one value per band.
const SUN: Spectrum = [
    165.5, 162.3, 211.2, 258.8, 258.2, 242.3, 267.6, 296.6, 305.4, 300.6, 306.6, 288.3, 287.1, 278.2, 271.0, 272.3,
    263.6, 255.0, 250.6, 253.1, 253.5, 251.3, 246.3, 241.7, 236.8, 232.1, 228.2, 223.4, 219.7, 215.3, 211.0, 207.3,
    202.4, 198.7, 194.3, 190.7,
];
/// Absorption of ozone, 1/cm (the same table; linear where it has no value).
const OZONE: Spectrum = [
    0.000_8, 0.001_2, 0.001_5, 0.001_8, 0.002_2, 0.002_5, 0.002_8, 0.003, 0.006, 0.009, 0.014, 0.021, 0.03, 0.04,
    0.048, 0.063, 0.075, 0.085, 0.103, 0.12, 0.12, 0.115, 0.125, 0.12, 0.105, 0.09, 0.079, 0.067, 0.057, 0.048, 0.036,
    0.028, 0.023, 0.018, 0.014, 0.011,
];
/// Thickness of the ozone, cm.
const OZONE_THICKNESS: f64 = 0.35;
/// Of aerosol over wavelength (Ångström).
const AEROSOL_EXPONENT: f64 = 1.3;
/// Solid angle of the sun, sr.
const SOLID_ANGLE: f64 = 6.8e-5;
/// Luminous efficacy, lm/W.
const EFFICACY: f64 = 683.0;

/// Refuses air for which the models of [`sunlight`] and [`Sky::clear`](super::Sky::clear) are not made.
pub(super) fn check_turbidity(turbidity: f64) -> Result<(), Error> {
    check_range("turbidity", turbidity, 1.7, 10.0, "from 1.7 (clearest) to 10 (haze)")
}

/// Refuses a sun below the horizon; its elevation, radians.
pub(super) fn check_elevation(towards_sun: &UnitVector3<f64>) -> Result<f64, Error> {
    let sine = towards_sun.z;
    check_range("elevation of the sun (sine)", sine, 0.0, 1.0 + 1e-9, "from 0 (horizon) to 1: by night use lamps")?;
    Ok(sine.min(1.0).asin())
}

/// The light of the sun (z up) through air of a turbidity (2 very clear, 3 clear, 6 hazy): linear sRGB, cd/m², of a white surface that faces it.
/// Rayleigh scattering, aerosol and ozone over the relative air mass (Preetham, Shirley, Smits 1999, Appendix), band by band; mixed gases
/// and water vapour, which absorb beyond 690 nm, are left out.
///
/// # Errors
/// A sun below the horizon, a turbidity outside 1.7..=10.
pub fn sunlight(towards_sun: &UnitVector3<f64>, turbidity: f64) -> Result<[f32; 3], Error> {
    check_turbidity(turbidity)?;
    let air_mass = air_mass(check_elevation(towards_sun)?);
    let aerosol = 0.046_083_658_2 * turbidity - 0.045_860_259_3;
    let spectrum: Spectrum = std::array::from_fn(|band| {
        let micrometres = wavelength(band) * 1e-3;
        let depth = 0.008_735 * micrometres.powf(-4.08)
            + aerosol * micrometres.powf(-AEROSOL_EXPONENT)
            + OZONE[band] * OZONE_THICKNESS;
        100.0 * SUN[band] * (-depth * air_mass).exp()
    });
    // A white surface spreads the light that it gets over π.
    let scale = EFFICACY * SOLID_ANGLE / PI;
    Ok(linear_srgb_of_emission(&spectrum).map(|c| (scale * c).max(0.0) as f32))
}

/// Relative optical air mass (Kasten 1965).
fn air_mass(elevation: f64) -> f64 {
    1.0 / (elevation.sin() + 0.15 * (3.885 + elevation.to_degrees()).powf(-1.253))
}
