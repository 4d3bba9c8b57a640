//! The paints to choose from, by formula (ours, free to use anywhere).

use paint_sim::Paint;
use paint_sim::colour::BANDS;

use crate::appearance::{UNIT_THICKNESS, charcoal, sandstone, spectrum};

/// A paint with a name.
pub(super) struct PaletteEntry {
    pub(super) name: &'static str,
    pub(super) paint: Paint,
    /// Colour of a thick coat, sRGB.
    pub(super) srgb: [u8; 3],
}

/// The palette, the first paint preset.
pub(super) fn palette() -> Result<Vec<PaletteEntry>, paint_sim::Error> {
    let rising = |at: f64, width: f64| move |l: f64| 0.03 + 2.4 / (1.0 + ((l - at) / width).exp());
    let red = Paint::new(&spectrum(rising(595.0, 9.0)), &[0.6; BANDS], UNIT_THICKNESS)?;
    let band = |l: f64| 0.04 + 2.0 * (1.0 - (-((l - 530.0) / 42.0).powi(2)).exp());
    let green = Paint::new(&spectrum(band), &[0.35; BANDS], UNIT_THICKNESS)?;
    let blue =
        Paint::new(&spectrum(|l| 0.05 + 2.2 / (1.0 + (-(l - 510.0) / 16.0).exp())), &[0.3; BANDS], UNIT_THICKNESS)?;
    let paints = [
        ("charcoal", charcoal()?),
        ("red", red),
        ("yellow", Paint::yellow(UNIT_THICKNESS)?),
        ("green", green),
        ("blue", blue),
        ("white", Paint::white(UNIT_THICKNESS)?),
    ];
    let ground = sandstone()?;
    let entry = |(name, paint): (&'static str, Paint)| {
        let srgb = paint.over(4.0 * UNIT_THICKNESS, &ground)?.srgb().rgb;
        Ok(PaletteEntry { name, paint, srgb })
    };
    paints.into_iter().map(entry).collect()
}
