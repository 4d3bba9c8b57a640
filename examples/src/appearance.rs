//! From paint thickness to ink and colour: a paint on sandstone, by Kubelka-Munk in 36 bands.

use paint_net::Saturation;
use paint_net::model::MonotoneCurve;
use paint_sim::colour::{BANDS, Spectrum, spectrum_lab, wavelength, xyz};
use paint_sim::{Paint, Substrate};

use crate::srgb::srgb;

/// Film thickness that the painter calls a depth of 1, metres.
pub const UNIT_THICKNESS: f64 = 20e-6;
/// Density of the paint, kg/m³: an acrylic.
pub const DENSITY: f64 = 1200.0;
/// Deepest knot of the ink curve, in units of depth.
const DEEPEST: f64 = 4.0;
/// Knots of the curves.
const KNOTS: usize = 400;

/// How the wall looks under a film of paint.
pub struct Appearance {
    ink: Saturation,
    /// Linear sRGB and Lab at evenly spaced depths from 0 to `DEEPEST`.
    table: Vec<Shade>,
}

#[derive(Clone, Copy)]
struct Shade {
    linear: [f64; 3],
    lab: [f64; 3],
}

/// What is wrong with the paint. The built-in one is sound; the error exists because its parts are checked.
#[derive(Debug, thiserror::Error)]
pub enum AppearanceError {
    /// The simulator refused a coefficient.
    #[error(transparent)]
    Paint(#[from] paint_sim::Error),
    /// The ink did not rise with depth.
    #[error(transparent)]
    Curve(#[from] paint_net::Error),
}

impl Appearance {
    /// [`charcoal`] on [`sandstone`].
    pub fn charcoal_on_sandstone() -> Result<Self, AppearanceError> {
        Self::on_sandstone(&charcoal()?)
    }

    /// A paint on [`sandstone`]. Ink is a scale of thickness, that of [`charcoal`] for every paint: the grey of a coloured or white paint
    /// need not fall with its thickness.
    pub fn on_sandstone(paint: &Paint) -> Result<Self, AppearanceError> {
        let (wall, scale) = (sandstone()?, charcoal()?);
        let at = |paint: &Paint, depth: f64| paint.over(depth * UNIT_THICKNESS, &wall);

        let grey = |s: &Substrate| srgb(xyz(s.reflectance())[1]);
        let bare = grey(&wall);
        // Ten times the deepest knot is opaque to rounding.
        let darkest = grey(&at(&scale, 10.0 * DEEPEST)?);
        let mut knots = Vec::with_capacity(KNOTS);
        let mut table = Vec::with_capacity(KNOTS);
        for k in 0..KNOTS {
            let depth = DEEPEST * k as f64 / (KNOTS - 1) as f64;
            knots.push((depth, if k == 0 { 0.0 } else { (bare - grey(&at(&scale, depth)?)) / (bare - darkest) }));
            let film = at(paint, depth)?;
            let linear = paint_sim::colour::spectrum_linear_srgb(film.reflectance());
            table.push(Shade { linear, lab: spectrum_lab(film.reflectance()) });
        }
        Ok(Self { ink: Saturation::Curve(MonotoneCurve::new(&knots)?), table })
    }

    /// Ink as a function of depth: the share of the way from the bare wall's grey to opaque paint's, in sRGB greys.
    pub fn ink(&self) -> &Saturation {
        &self.ink
    }

    /// Linear sRGB at a depth.
    pub fn linear(&self, depth: f64) -> [f64; 3] {
        self.mix(depth, |s| s.linear)
    }

    /// sRGB bytes at a depth.
    pub fn srgb(&self, depth: f64) -> [u8; 3] {
        self.linear(depth).map(|c| paint_sim::colour::encode_srgb8(c).0)
    }

    /// CIELAB at a depth.
    pub fn lab(&self, depth: f64) -> [f64; 3] {
        self.mix(depth, |s| s.lab)
    }

    fn mix(&self, depth: f64, of: impl Fn(&Shade) -> [f64; 3]) -> [f64; 3] {
        let at = (depth / DEEPEST).clamp(0.0, 1.0) * (self.table.len() - 1) as f64;
        let k = (at as usize).min(self.table.len() - 2);
        let (a, b, t) = (of(&self.table[k]), of(&self.table[k + 1]), at - k as f64);
        std::array::from_fn(|i| a[i] + t * (b[i] - a[i]))
    }
}

/// Sandstone (ours): reflectance rising from 0.38 in the blue to 0.74 in the red.
pub fn sandstone() -> Result<Substrate, paint_sim::Error> {
    Substrate::new(spectrum(|l| 0.38 + 0.36 / (1.0 + (-(l - 530.0) / 45.0).exp())))
}

/// Charcoal paint (ours): strong, almost flat absorption, little scattering.
pub fn charcoal() -> Result<Paint, paint_sim::Error> {
    Paint::new(&spectrum(|l| 1.5 - 0.0002 * (l - 380.0)), &[0.08; BANDS], UNIT_THICKNESS)
}

/// A spectrum by formula of the wavelength, nm.
pub(crate) fn spectrum(of_wavelength: impl Fn(f64) -> f64) -> Spectrum {
    std::array::from_fn(|k| of_wavelength(wavelength(k)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_paint_is_darker_and_ink_inverts() {
        let appearance = Appearance::charcoal_on_sandstone().unwrap();
        let mut last = 1.0;
        for k in 0..100 {
            let depth = 0.03 * f64::from(k);
            let lightness = appearance.lab(depth)[0] / 100.0;
            assert!(lightness < last);
            last = lightness;
            let ink = appearance.ink().forward(depth);
            assert!((appearance.ink().inverse(ink) - depth).abs() < 1e-6);
        }
        let [r, g, b] = appearance.srgb(0.0);
        assert!(r > g && g > b, "sandstone is warm");
    }
}
