//! Paints, and how their mixtures look on a substrate.

use super::kubelka_munk::reflectance;
use crate::error::{Error, require};

/// Largest number of paints in a palette.
pub const MAX_PAINTS: usize = 6;

/// A paint: what one unit of depth absorbs and scatters in each of three bands (Kubelka and Munk's `K` and `S`).
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Paint {
    /// Its name.
    pub name: String,
    /// Absorption per unit depth, 0 or more.
    pub absorption: [f64; 3],
    /// Scattering per unit depth, 0 or more; 0 for a glaze.
    pub scattering: [f64; 3],
}

impl Paint {
    /// A glaze: unit depth over white looks like `colour`, values in `(0, 1]`. Beer-Lambert.
    pub fn glaze(name: &str, colour: [f64; 3]) -> Self {
        Self { name: name.to_string(), absorption: colour.map(|c| -0.5 * c.ln()), scattering: [0.0; 3] }
    }

    /// A covering paint: infinitely deep it looks like `colour`, values in `(0, 1)`, and unit depth scatters `scattering`.
    /// `K/S = (1 - R)² / 2R` (Kubelka and Munk 1931).
    pub fn opaque(name: &str, colour: [f64; 3], scattering: f64) -> Self {
        let absorption = colour.map(|r| scattering * (1.0 - r).powi(2) / (2.0 * r));
        Self { name: name.to_string(), absorption, scattering: [scattering; 3] }
    }
}

/// Paints that are sprayed one over the other while wet, so that they mix: a film of the depths `d` absorbs `Σ d_p K_p` and
/// scatters `Σ d_p S_p` over the substrate.
///
/// Bands are those of the picture: reflectances, or the stored values of sRGB, on which glazes behave much alike.
#[derive(Debug, Clone, PartialEq)]
pub struct Palette {
    substrate: [f64; 3],
    paints: Vec<Paint>,
}

impl Palette {
    /// One to six paints on a substrate, its colour in `[0, 1]`.
    pub fn new(substrate: [f64; 3], paints: Vec<Paint>) -> Result<Self, Error> {
        let count = paints.len();
        require("paints", count as f64, (1..=MAX_PAINTS).contains(&count), "a palette has 1 to 6 paints")?;
        for value in substrate {
            require("substrate", value, (0.0..=1.0).contains(&value), "it must lie in [0, 1]")?;
        }
        for paint in &paints {
            for (name, values) in [("absorption", paint.absorption), ("scattering", paint.scattering)] {
                for v in values {
                    require(name, v, (0.0..=1e6).contains(&v), "it must lie in [0, 1000000] per unit depth")?;
                }
            }
            let does = paint.absorption.iter().chain(&paint.scattering).sum::<f64>();
            require("absorption", does, does > 0.0, "a paint must absorb or scatter something")?;
        }
        Ok(Self { substrate, paints })
    }

    /// Its paints.
    pub fn paints(&self) -> &[Paint] {
        &self.paints
    }

    /// Colour of the bare substrate.
    pub fn substrate(&self) -> [f64; 3] {
        self.substrate
    }

    /// Colour of a film with one depth per paint; those missing count as 0.
    pub fn colour(&self, depths: &[f64]) -> [f64; 3] {
        self.film(depths, &mut [])
    }

    /// Derivative of `Σ_band weight · colour` by every depth: the vector-Jacobian product.
    pub fn adjoint(&self, depths: &[f64], weight: [f64; 3]) -> Vec<f64> {
        let mut slopes = vec![[0.0; 3]; self.paints.len()];
        self.film(depths, &mut slopes);
        slopes.iter().map(|s| s.iter().zip(weight).map(|(s, w)| s * w).sum()).collect()
    }

    /// Colour, and its derivative by the depth of as many paints as `slopes` has room for.
    fn film(&self, depths: &[f64], slopes: &mut [[f64; 3]]) -> [f64; 3] {
        std::array::from_fn(|band| {
            let (mut k, mut s) = (0.0, 0.0);
            for (paint, depth) in self.paints.iter().zip(depths) {
                k += depth * paint.absorption[band];
                s += depth * paint.scattering[band];
            }
            if s == 0.0 && self.paints.iter().all(|p| p.scattering[band] == 0.0) {
                // Beer-Lambert costs one exponential.
                let colour = self.substrate[band] * (-2.0 * k).exp();
                for (slope, paint) in slopes.iter_mut().zip(&self.paints) {
                    slope[band] = -2.0 * colour * paint.absorption[band];
                }
                return colour;
            }
            let film = reflectance(k, s, self.substrate[band]);
            for (slope, paint) in slopes.iter_mut().zip(&self.paints) {
                slope[band] = film.by_absorption * paint.absorption[band] + film.by_scattering * paint.scattering[band];
            }
            film.value
        })
    }
}
