//! Three pigments by formula, free to use anywhere.

use super::Paint;
use crate::Error;
use crate::colour::{BANDS, Spectrum, wavelength};

fn spectrum(of_wavelength: impl Fn(f64) -> f64) -> Spectrum {
    std::array::from_fn::<_, BANDS, _>(|band| of_wavelength(wavelength(band)))
}

impl Paint {
    /// A yellow (ours): absorbs below 500 nm. `unit_thickness` is the film, in metres, whose `K d` and `S d` are the
    /// formula's `0.02 + 3 / (1 + exp((l - 500)/12))` and 0.8.
    ///
    /// # Errors
    /// A thickness that is not positive.
    pub fn yellow(unit_thickness: f64) -> Result<Self, Error> {
        let k = spectrum(|l| 0.02 + 3.0 / (1.0 + ((l - 500.0) / 12.0).exp()));
        Self::new(&k, &[0.8; BANDS], unit_thickness)
    }

    /// A glazing blue (ours): absorbs above 540 nm, `K d = 0.05 + 1.5 / (1 + exp(-(l - 540)/20))`, `S d = 0.15`.
    ///
    /// # Errors
    /// A thickness that is not positive.
    pub fn blue(unit_thickness: f64) -> Result<Self, Error> {
        let k = spectrum(|l| 0.05 + 1.5 / (1.0 + (-(l - 540.0) / 20.0).exp()));
        Self::new(&k, &[0.15; BANDS], unit_thickness)
    }

    /// A white (ours): `K d = 0.0005 + 0.3 exp(-(l - 380)/12)`, `S d = 1`.
    ///
    /// # Errors
    /// A thickness that is not positive.
    pub fn white(unit_thickness: f64) -> Result<Self, Error> {
        let k = spectrum(|l| 0.0005 + 0.3 * (-(l - 380.0) / 12.0).exp());
        Self::new(&k, &[1.0; BANDS], unit_thickness)
    }
}
