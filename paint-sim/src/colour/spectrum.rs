//! Spectra by bands.

/// Number of spectral bands: 380 to 730 nm in steps of 10 nm.
pub const BANDS: usize = 36;

/// One value per band.
pub type Spectrum = [f64; BANDS];

/// Wavelength of a band, nm.
pub fn wavelength(band: usize) -> f64 {
    380.0 + 10.0 * band as f64
}
