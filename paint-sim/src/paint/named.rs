//! Paints by name, by formula (ours, free to use anywhere).

use super::{Paint, Substrate, spectrum};
use crate::colour::BANDS;
use crate::error::Error;

/// Paints by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
pub enum PaintName {
    /// Strong, almost flat absorption.
    #[default]
    Charcoal,
    /// Lets wavelengths above 595 nm pass.
    Red,
    /// Lets wavelengths above green pass: [`Paint::yellow`].
    Yellow,
    /// Lets a band about 530 nm pass.
    Green,
    /// Lets wavelengths below 510 nm pass; hides better than [`Paint::blue`], a glaze.
    Blue,
    /// Scatters, hardly absorbs: [`Paint::white`].
    White,
}

impl PaintName {
    /// All of them.
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

    /// Its absorption and scattering; `unit_thickness` is the film, metres, for which the formulas hold.
    ///
    /// # Errors
    /// A thickness that is not positive.
    pub fn paint(self, unit_thickness: f64) -> Result<Paint, Error> {
        let of = |absorption: &dyn Fn(f64) -> f64, scattering: f64| {
            Paint::new(&spectrum(absorption), &[scattering; BANDS], unit_thickness)
        };
        match self {
            Self::Charcoal => of(&|l| 1.5 - 0.0002 * (l - 380.0), 0.08),
            Self::Red => of(&|l| 0.03 + 2.4 / (1.0 + ((l - 595.0) / 9.0).exp()), 0.6),
            Self::Yellow => Paint::yellow(unit_thickness),
            Self::Green => of(&|l| 0.04 + 2.0 * (1.0 - (-((l - 530.0) / 42.0).powi(2)).exp()), 0.35),
            Self::Blue => of(&|l| 0.05 + 2.2 / (1.0 + (-(l - 510.0) / 16.0).exp()), 0.3),
            Self::White => Paint::white(unit_thickness),
        }
    }
}

impl Substrate {
    /// Sandstone: reflectance rising from 0.38 in the blue to 0.74 in the red.
    pub fn sandstone() -> Self {
        Self { reflectance: spectrum(|l| 0.38 + 0.36 / (1.0 + (-(l - 530.0) / 45.0).exp())) }
    }
}
