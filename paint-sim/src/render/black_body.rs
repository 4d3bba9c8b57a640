//! Light of a colour temperature.

use crate::colour::{Spectrum, emission_xyz, linear_srgb_of_emission, wavelength};
use crate::error::{Error, check_range};

/// Second radiation constant, nm K (CODATA 2018).
const C2: f64 = 1.438_776_877e7;

/// Linear sRGB of a black body (Planck's law) of a temperature in kelvin, luminance 1. Components that sRGB has not, blue below about 1900 K,
/// are zero. Illuminant A of the CIE is one of 2856 K; lamps are sold by the temperature that they look like: 2000 sodium, 3000 warm and 4000
/// neutral LED.
///
/// # Errors
/// A temperature outside 1000..=25000 K.
pub fn black_body(temperature: f64) -> Result<[f32; 3], Error> {
    check_range("colour temperature", temperature, 1000.0, 25_000.0, "from 1000 to 25000 K")?;
    // Relative to the middle of the bands, so that no power overflows.
    let exponent = |nm: f64| C2 / (nm * temperature);
    let power = |nm: f64| (560.0 / nm).powi(5) * (exponent(560.0).exp_m1() / exponent(nm).exp_m1());
    let spectrum: Spectrum = std::array::from_fn(|band| power(wavelength(band)));
    let luminance = emission_xyz(&spectrum)[1];
    Ok(linear_srgb_of_emission(&spectrum).map(|c| (c / luminance).max(0.0) as f32))
}
