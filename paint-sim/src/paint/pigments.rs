//! Artists' pigments by formula (ours, free to use anywhere): absorption edges and bands where those of the pigments lie.

use super::{Paint, spectrum};
use crate::error::Error;

/// A pigment in an acrylic, by formula. Published tables of `K` and `S` may mostly not be passed on; their edges and bands are facts.
#[derive(Debug, Clone, Copy)]
pub struct Pigment {
    /// Its name in lower case.
    pub name: &'static str,
    /// Its generic name in the Colour Index.
    pub colour_index: &'static str,
    /// `K d` at a wavelength in nm.
    absorption: fn(f64) -> f64,
    /// `S d`.
    scattering: fn(f64) -> f64,
}

impl Pigment {
    /// The paint whose film of `unit_thickness` metres has the formula's `K d` and `S d`.
    ///
    /// # Errors
    /// A thickness that is not positive.
    pub fn paint(&self, unit_thickness: f64) -> Result<Paint, Error> {
        Paint::new(&spectrum(self.absorption), &spectrum(self.scattering), unit_thickness)
    }
}

/// One below a wavelength, 0 above.
fn below(l: f64, edge: f64, width: f64) -> f64 {
    1.0 / (1.0 + ((l - edge) / width).exp())
}

/// One above it.
fn above(l: f64, edge: f64, width: f64) -> f64 {
    below(-l, -edge, width)
}

/// A band about a wavelength.
fn band(l: f64, centre: f64, width: f64) -> f64 {
    (-((l - centre) / width).powi(2)).exp()
}

/// Those that a wall is painted with outdoors: all of them fast to light.
pub const PIGMENTS: [Pigment; 12] = [
    Pigment {
        name: "titanium white",
        colour_index: "PW6",
        absorption: |l| 0.001 + 0.9 * below(l, 396.0, 6.0),
        scattering: |_| 2.5,
    },
    Pigment {
        name: "carbon black",
        colour_index: "PBk7",
        absorption: |l| 1.3 - 0.0003 * (l - 380.0),
        scattering: |_| 0.012,
    },
    Pigment {
        name: "hansa yellow",
        colour_index: "PY74",
        absorption: |l| 0.006 + 2.2 * below(l, 492.0, 8.0),
        scattering: |_| 0.12,
    },
    Pigment {
        name: "ochre",
        colour_index: "PY42",
        absorption: |l| 0.1 + 1.3 * below(l, 532.0, 20.0),
        scattering: |_| 0.3,
    },
    Pigment {
        name: "pyrrole orange",
        colour_index: "PO73",
        absorption: |l| 0.006 + 3.0 * below(l, 570.0, 9.0),
        scattering: |_| 0.15,
    },
    Pigment {
        name: "pyrrole red",
        colour_index: "PR254",
        absorption: |l| 0.008 + 2.8 * below(l, 598.0, 8.0) - 0.5 * band(l, 430.0, 35.0),
        scattering: |_| 0.12,
    },
    Pigment {
        name: "quinacridone magenta",
        colour_index: "PR122",
        absorption: |l| 0.008 + 1.7 * band(l, 562.0, 26.0) + 1.5 * band(l, 520.0, 34.0) + 0.35 * below(l, 480.0, 25.0),
        scattering: |_| 0.05,
    },
    Pigment {
        name: "dioxazine violet",
        colour_index: "PV23",
        absorption: |l| 0.03 + 2.0 * band(l, 555.0, 45.0) + 0.9 * band(l, 615.0, 24.0) + 0.2 * below(l, 410.0, 15.0),
        scattering: |_| 0.03,
    },
    Pigment {
        name: "ultramarine",
        colour_index: "PB29",
        absorption: |l| 0.015 + 2.0 * band(l, 578.0, 62.0) + 0.3 * band(l, 650.0, 40.0),
        scattering: |_| 0.04,
    },
    Pigment {
        name: "phthalo blue",
        colour_index: "PB15:3",
        absorption: |l| 0.012 + 2.1 * above(l, 572.0, 16.0) * below(l, 735.0, 22.0) + 0.25 * below(l, 405.0, 14.0),
        scattering: |_| 0.04,
    },
    Pigment {
        name: "phthalo green",
        colour_index: "PG7",
        absorption: |l| 0.03 + 1.9 * above(l, 592.0, 14.0) + 1.1 * below(l, 452.0, 14.0),
        scattering: |_| 0.04,
    },
    Pigment {
        name: "burnt sienna",
        colour_index: "PBr7",
        absorption: |l| 0.3 + 1.6 * below(l, 570.0, 22.0),
        scattering: |_| 0.18,
    },
];
