//! From paint thickness to ink and colour: a paint on sandstone.

use paint_net::Saturation;
use paint_net::model::MonotoneCurve;
use paint_sim::paint::{PaintName, ink_curve};
use paint_sim::{Paint, Substrate};

/// Film thickness that the painter calls a depth of 1, metres.
pub const UNIT_THICKNESS: f64 = 20e-6;
/// Density of the paint, kg/m³: an acrylic.
pub const DENSITY: f64 = 1200.0;
/// Deepest knot of the ink curve, in units of depth.
pub(crate) const DEEPEST: f64 = 4.0;

/// How the wall looks under a film of paint.
#[derive(Clone)]
pub struct Appearance {
    ink: Saturation,
    colours: paint_sim::paint::Appearance,
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
    /// Charcoal on sandstone.
    pub fn charcoal_on_sandstone() -> Result<Self, AppearanceError> {
        Self::new(&PaintName::Charcoal.paint(UNIT_THICKNESS)?, &Substrate::sandstone())
    }

    /// A paint on a wall. Ink is a scale of thickness, that of charcoal on sandstone for every paint and wall: the grey of a coloured or white
    /// paint need not fall with its thickness.
    pub fn new(paint: &Paint, wall: &Substrate) -> Result<Self, AppearanceError> {
        let (stone, scale) = (Substrate::sandstone(), PaintName::Charcoal.paint(UNIT_THICKNESS)?);
        let knots = ink_curve(&scale, &stone, UNIT_THICKNESS, DEEPEST)?;
        let colours = paint_sim::paint::Appearance::new(paint, wall, UNIT_THICKNESS, DEEPEST)?;
        Ok(Self { ink: Saturation::Curve(MonotoneCurve::new(&knots)?), colours })
    }

    /// Ink as a function of depth: the share of the way from the bare wall's grey to opaque paint's, in sRGB greys.
    pub fn ink(&self) -> &Saturation {
        &self.ink
    }

    /// Linear sRGB at a depth.
    pub fn linear(&self, depth: f64) -> [f64; 3] {
        self.colours.linear(depth)
    }

    /// sRGB bytes at a depth.
    pub fn srgb(&self, depth: f64) -> [u8; 3] {
        self.colours.srgb(depth)
    }

    /// CIELAB at a depth.
    pub fn lab(&self, depth: f64) -> [f64; 3] {
        self.colours.lab(depth)
    }
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
