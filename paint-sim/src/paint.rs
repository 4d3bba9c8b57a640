//! Paints and grounds with 36 bands: from the thickness of a film to the colour one sees.

mod appearance;
mod chart;
mod drawdown;
mod film_colours;
mod film_stack;
#[cfg(feature = "gpu")]
mod gpu_film_colours;
mod named;
mod pigments;

pub use appearance::{Appearance, ink_curve};
pub use chart::{ChartFit, Patch};
pub use drawdown::Drawdown;
pub use film_colours::FilmColours;
pub use film_stack::{Bands, FilmStack, MOST_FILMS};
#[cfg(feature = "gpu")]
pub use gpu_film_colours::GpuFilmColours;
pub use named::PaintName;
pub use pigments::{PIGMENTS, Pigment};

use crate::colour::{BANDS, Spectrum, Srgb8, spectrum_srgb8, wavelength};
use crate::error::{Error, check_not_negative, check_positive, check_range};
use crate::km;

/// What lies below the paint: an opaque ground.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Substrate {
    reflectance: Spectrum,
}

impl Substrate {
    /// A ground by its reflectance per band (as seen from inside the paint, that is without an air interface).
    ///
    /// # Errors
    /// Reflectances outside 0..=1.
    pub fn new(reflectance: Spectrum) -> Result<Self, Error> {
        for &value in &reflectance {
            check_range("reflectance of the ground", value, 0.0, 1.0, "between 0 and 1")?;
        }
        Ok(Self { reflectance })
    }

    /// A ground that reflects all bands alike.
    ///
    /// # Errors
    /// A reflectance outside 0..=1.
    pub fn grey(reflectance: f64) -> Result<Self, Error> {
        Self::new([reflectance; BANDS])
    }

    /// Reflectance per band.
    pub fn reflectance(&self) -> &Spectrum {
        &self.reflectance
    }

    /// The screen colour under D65.
    pub fn srgb(&self) -> Srgb8 {
        spectrum_srgb8(&self.reflectance)
    }
}

/// A paint by its Kubelka-Munk coefficients per metre of film.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Paint {
    absorption: Spectrum,
    scattering: Spectrum,
}

impl Paint {
    /// A paint by absorption K and scattering S per band for a film of `unit_thickness` metres: published K and S are
    /// mostly relative, and this length gives them their scale.
    ///
    /// # Errors
    /// Coefficients that are negative or not finite, or a thickness that is not positive.
    pub fn new(absorption: &Spectrum, scattering: &Spectrum, unit_thickness: f64) -> Result<Self, Error> {
        check_positive("unit thickness of a paint", unit_thickness)?;
        for (&k, &s) in absorption.iter().zip(scattering) {
            check_not_negative("absorption of a paint", k / unit_thickness)?;
            check_not_negative("scattering of a paint", s / unit_thickness)?;
        }
        let per_metre = |spectrum: &Spectrum| spectrum.map(|v| v / unit_thickness);
        Ok(Self { absorption: per_metre(absorption), scattering: per_metre(scattering) })
    }

    /// The wet mixture of paints by volume: `K = sum c_i K_i`, `S = sum c_i S_i` (Duncan 1940). Parts need not sum to one.
    ///
    /// # Errors
    /// No parts, or parts that are negative, not finite or all zero.
    pub fn mix(parts: &[(Self, f64)]) -> Result<Self, Error> {
        for (_, part) in parts {
            check_not_negative("part of a mixture", *part)?;
        }
        let total: f64 = parts.iter().map(|(_, part)| part).sum();
        if parts.is_empty() {
            return Err(Error::Empty { what: "mixture" });
        }
        check_positive("sum of the parts of a mixture", total)?;
        let blend = |of: fn(&Self) -> &Spectrum| {
            std::array::from_fn(|band| parts.iter().map(|(paint, part)| of(paint)[band] * part / total).sum())
        };
        Ok(Self { absorption: blend(Self::absorption), scattering: blend(Self::scattering) })
    }

    /// Absorption per metre.
    pub fn absorption(&self) -> &Spectrum {
        &self.absorption
    }

    /// Scattering per metre.
    pub fn scattering(&self) -> &Spectrum {
        &self.scattering
    }

    /// The ground with a dry film of `thickness` metres on it. Coats are stacked by painting the result again.
    ///
    /// # Errors
    /// A thickness that is negative or not finite.
    pub fn over(&self, thickness: f64, ground: &Substrate) -> Result<Substrate, Error> {
        check_not_negative("thickness of a film", thickness)?;
        let band = |i: usize| km::reflectance(self.absorption[i], self.scattering[i], thickness, ground.reflectance[i]);
        Ok(Substrate { reflectance: std::array::from_fn(band) })
    }

    /// A yellow: absorbs below 500 nm. `unit_thickness` is the film, in metres, whose `K d` and `S d` are the
    /// formula's `0.02 + 3 / (1 + exp((l - 500)/12))` and 0.8.
    ///
    /// # Errors
    /// A thickness that is not positive.
    pub fn yellow(unit_thickness: f64) -> Result<Self, Error> {
        let k = spectrum(|l| 0.02 + 3.0 / (1.0 + ((l - 500.0) / 12.0).exp()));
        Self::new(&k, &[0.8; BANDS], unit_thickness)
    }

    /// A glazing blue: absorbs above 540 nm, `K d = 0.05 + 1.5 / (1 + exp(-(l - 540)/20))`, `S d = 0.15`.
    ///
    /// # Errors
    /// A thickness that is not positive.
    pub fn blue(unit_thickness: f64) -> Result<Self, Error> {
        let k = spectrum(|l| 0.05 + 1.5 / (1.0 + (-(l - 540.0) / 20.0).exp()));
        Self::new(&k, &[0.15; BANDS], unit_thickness)
    }

    /// A white: `K d = 0.0005 + 0.3 exp(-(l - 380)/12)`, `S d = 1`.
    ///
    /// # Errors
    /// A thickness that is not positive.
    pub fn white(unit_thickness: f64) -> Result<Self, Error> {
        let k = spectrum(|l| 0.0005 + 0.3 * (-(l - 380.0) / 12.0).exp());
        Self::new(&k, &[1.0; BANDS], unit_thickness)
    }
}

/// Pigments by formula are free to use anywhere.
fn spectrum(of_wavelength: impl Fn(f64) -> f64) -> Spectrum {
    std::array::from_fn::<_, BANDS, _>(|band| of_wavelength(wavelength(band)))
}
