//! Paints as a file: what each absorbs and scatters, or a drawdown from which that follows.

use std::path::Path;

use paint_sim::Paint;
use paint_sim::colour::{BANDS, Spectrum};
use paint_sim::film::wet::WetPaint;
use paint_sim::paint::{Drawdown, PIGMENTS, PaintName};
use serde::Deserialize;

use crate::appearance::UNIT_THICKNESS;

/// A paint with its name and what a tank of it holds.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedPaint {
    /// Its name, also that of its folder of results.
    pub name: String,
    /// How it looks.
    pub paint: Paint,
    /// What it is as long as it is wet.
    pub liquid: WetPaint,
}

impl NamedPaint {
    /// A built-in paint of one colour.
    ///
    /// # Errors
    /// None for the thickness that the programs use.
    pub fn built_in(name: PaintName) -> Result<Self, paint_sim::Error> {
        let paint = name.paint(UNIT_THICKNESS)?;
        Ok(Self { name: name.as_str().to_owned(), paint, liquid: WetPaint::default() })
    }

    /// Its folder among the results, by its place in the order, from 1.
    pub(crate) fn folder(&self, place: usize) -> String {
        let plain = |c: char| if c.is_alphanumeric() { c } else { '_' };
        format!("{place}_{}", self.name.chars().map(plain).collect::<String>())
    }
}

/// A file of paints. Spectra have 36 bands, 380 to 730 nm in steps of 10 nm.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct PaintFile {
    paints: Vec<PaintEntry>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct PaintEntry {
    name: String,
    /// Thickness of the dry film that the spectra hold for, metres.
    film: f64,
    /// `K d` and `S d` of that film.
    absorption: Option<Vec<f64>>,
    scattering: Option<Vec<f64>>,
    /// Reflectance of that film over the black and the white of a card, and of the card's two halves.
    over_black: Option<Vec<f64>>,
    over_white: Option<Vec<f64>>,
    #[serde(default = "ideal_card")]
    card: [f64; 2],
    /// What the usual paint has where nothing is said, see [`WetPaint`].
    density: Option<f64>,
    solids: Option<f64>,
    viscosity: Option<f64>,
    yield_stress: Option<f64>,
}

fn ideal_card() -> [f64; 2] {
    [0.0, 1.0]
}

/// What is wrong with a file of paints.
#[derive(Debug, thiserror::Error)]
pub enum PaintSetError {
    /// The file cannot be read.
    #[error("{path}: {source}")]
    File {
        /// The file.
        path: String,
        /// What the system said.
        source: std::io::Error,
    },
    /// It is no file of paints.
    #[error("{path}: {why}")]
    Malformed {
        /// The file.
        path: String,
        /// The place, and what is wrong there.
        why: String,
    },
    /// A paint that makes no sense.
    #[error("{path}: paint \"{name}\": {why}")]
    Paint {
        /// The file.
        path: String,
        /// The paint.
        name: String,
        /// What is wrong.
        why: String,
    },
}

/// The artists' pigments that the programs know by themselves.
pub fn artists_paints() -> Result<Vec<NamedPaint>, paint_sim::Error> {
    let named = |pigment: &paint_sim::paint::Pigment| {
        let paint = pigment.paint(UNIT_THICKNESS)?;
        Ok(NamedPaint { name: pigment.name.to_owned(), paint, liquid: WetPaint::default() })
    };
    PIGMENTS.iter().map(named).collect()
}

/// Reads a file of paints, in their order.
pub fn read_paints(path: &Path) -> Result<Vec<NamedPaint>, PaintSetError> {
    let name = || path.display().to_string();
    let text = std::fs::read_to_string(path).map_err(|source| PaintSetError::File { path: name(), source })?;
    let malformed = |why: String| PaintSetError::Malformed { path: name(), why };
    let file: PaintFile = toml::from_str(&text).map_err(|error| malformed(error.to_string().trim_end().to_owned()))?;
    if file.paints.is_empty() {
        return Err(malformed("has no paints: give each as [[paints]]".into()));
    }
    for (k, entry) in file.paints.iter().enumerate() {
        if file.paints[..k].iter().any(|other| other.name == entry.name) {
            return Err(malformed(format!("two paints are called \"{}\"", entry.name)));
        }
    }
    let paint = |entry: &PaintEntry| {
        entry.paint().map_err(|why| PaintSetError::Paint { path: name(), name: entry.name.clone(), why })
    };
    file.paints.iter().map(paint).collect()
}

impl PaintEntry {
    fn paint(&self) -> Result<NamedPaint, String> {
        if self.name.trim().is_empty() {
            return Err("give it a name".into());
        }
        let liquid = self.liquid().map_err(|error| error.to_string())?;
        let paint = match (&self.absorption, &self.scattering, &self.over_black, &self.over_white) {
            (Some(k), Some(s), None, None) => {
                let (k, s) = (spectrum("absorption", k)?, spectrum("scattering", s)?);
                if (0..BANDS).all(|band| k[band] == 0.0 && s[band] == 0.0) {
                    return Err("it neither absorbs nor scatters: nothing of it would be seen".into());
                }
                Paint::new(&k, &s, self.film)
            }
            (None, None, Some(black), Some(white)) => Paint::from_drawdown(&Drawdown {
                black: [self.card[0]; BANDS],
                white: [self.card[1]; BANDS],
                over_black: spectrum("over_black", black)?,
                over_white: spectrum("over_white", white)?,
                thickness: self.film,
            }),
            _ => return Err("give absorption and scattering, or over_black and over_white".into()),
        };
        let paint = paint.map_err(|error| error.to_string())?;
        Ok(NamedPaint { name: self.name.clone(), paint, liquid })
    }

    fn liquid(&self) -> Result<WetPaint, paint_sim::Error> {
        let usual = WetPaint::default();
        let liquid = WetPaint {
            density: self.density.unwrap_or(usual.density),
            viscosity: self.viscosity.unwrap_or(usual.viscosity),
            yield_stress: self.yield_stress.unwrap_or(usual.yield_stress),
            ..self.solids.map_or(usual, WetPaint::of_solids)
        };
        liquid.check().map(|()| liquid)
    }
}

fn spectrum(what: &str, values: &[f64]) -> Result<Spectrum, String> {
    values
        .try_into()
        .map_err(|_| format!("{what} has {} values, it needs {BANDS}: 380 to 730 nm by 10 nm", values.len()))
}
