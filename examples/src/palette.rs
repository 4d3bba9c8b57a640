//! The paints to choose from, by formula (ours, free to use anywhere).

use paint_sim::Paint;
use paint_sim::colour::BANDS;
use serde::{Deserialize, Serialize};

use crate::appearance::{UNIT_THICKNESS, charcoal, sandstone, spectrum};

/// The paints by name, in the order of the palette.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PaintName {
    /// Strong, almost flat absorption.
    #[default]
    Charcoal,
    /// Lets wavelengths above 595 nm pass.
    Red,
    /// Lets wavelengths above green pass.
    Yellow,
    /// Lets a band about 530 nm pass.
    Green,
    /// Lets wavelengths below 510 nm pass.
    Blue,
    /// Scatters, hardly absorbs.
    White,
}

impl PaintName {
    /// All of them; the number of a paint in a session is its place here.
    pub const ALL: [Self; 6] = [Self::Charcoal, Self::Red, Self::Yellow, Self::Green, Self::Blue, Self::White];

    /// The name as files have it.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Charcoal => "charcoal",
            Self::Red => "red",
            Self::Yellow => "yellow",
            Self::Green => "green",
            Self::Blue => "blue",
            Self::White => "white",
        }
    }

    /// Its absorption and scattering.
    ///
    /// # Errors
    /// None for these coefficients; the simulator checks them.
    pub fn paint(self) -> Result<Paint, paint_sim::Error> {
        let of = |absorption: &dyn Fn(f64) -> f64, scattering: f64| {
            Paint::new(&spectrum(absorption), &[scattering; BANDS], UNIT_THICKNESS)
        };
        match self {
            Self::Charcoal => charcoal(),
            Self::Red => of(&|l| 0.03 + 2.4 / (1.0 + ((l - 595.0) / 9.0).exp()), 0.6),
            Self::Yellow => Paint::yellow(UNIT_THICKNESS),
            Self::Green => of(&|l| 0.04 + 2.0 * (1.0 - (-((l - 530.0) / 42.0).powi(2)).exp()), 0.35),
            Self::Blue => of(&|l| 0.05 + 2.2 / (1.0 + (-(l - 510.0) / 16.0).exp()), 0.3),
            Self::White => Paint::white(UNIT_THICKNESS),
        }
    }
}

/// A paint with a name.
pub(crate) struct PaletteEntry {
    pub(crate) name: PaintName,
    pub(crate) paint: Paint,
    /// Colour of a thick coat, sRGB.
    pub(crate) srgb: [u8; 3],
}

/// The palette, the first paint preset.
pub(crate) fn palette() -> Result<Vec<PaletteEntry>, paint_sim::Error> {
    let ground = sandstone()?;
    let entry = |name: PaintName| {
        let paint = name.paint()?;
        let srgb = paint.over(4.0 * UNIT_THICKNESS, &ground)?.srgb().rgb;
        Ok(PaletteEntry { name, paint, srgb })
    };
    PaintName::ALL.into_iter().map(entry).collect()
}
