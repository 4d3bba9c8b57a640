//! Paint films of many thicknesses over 36 bands, in single and double precision.

use paint_sim::colour::{BANDS, Spectrum};
use paint_sim::paint::FilmColours;
use paint_sim::{Error, Paint, Substrate, km};

use crate::Rng;

/// Largest thickness, metres.
const THICKEST: f64 = 60e-6;

/// One paint on one ground, in many thicknesses.
pub struct Films {
    paint: Paint,
    ground: Substrate,
    thickness: Vec<f64>,
    narrow_thickness: Vec<f32>,
}

impl Films {
    /// `count` films of 0 to 60 µm.
    ///
    /// # Errors
    /// None that this paint is known to give; it is checked.
    pub fn new(count: usize) -> Result<Self, Error> {
        let mut rng = Rng::new(2);
        let thickness: Vec<f64> = (0..count).map(|_| rng.between(0.0, THICKEST)).collect();
        let narrow_thickness = thickness.iter().map(|&depth| depth as f32).collect();
        Ok(Self { paint: Paint::yellow(20e-6)?, ground: Substrate::grey(0.5)?, thickness, narrow_thickness })
    }

    /// Reflectance of every film in single precision.
    pub fn narrow(&self, reflectance: &mut [[f32; BANDS]]) {
        let single = |spectrum: &Spectrum| spectrum.map(|v| v as f32);
        let (k, s, ground) =
            (single(self.paint.absorption()), single(self.paint.scattering()), single(self.ground.reflectance()));
        for (film, &depth) in reflectance.iter_mut().zip(&self.thickness) {
            *film = std::array::from_fn(|j| km::reflectance_f32(k[j], s[j], depth as f32, ground[j]));
        }
    }

    /// Colour of every film for the screen, all bands of it.
    ///
    /// # Errors
    /// Not as many colours as films.
    pub fn srgb8(&self, colours: &mut [[u8; 3]]) -> Result<(), Error> {
        FilmColours::new(&self.paint, &self.ground).srgb8(&self.narrow_thickness, colours)
    }

    /// Reflectance of every film in double precision.
    pub fn wide(&self, reflectance: &mut [Spectrum]) {
        let (k, s, ground) = (self.paint.absorption(), self.paint.scattering(), self.ground.reflectance());
        for (film, &depth) in reflectance.iter_mut().zip(&self.thickness) {
            *film = std::array::from_fn(|j| km::reflectance(k[j], s[j], depth, ground[j]));
        }
    }
}
