//! What is measured: one burst on a card, and how its readings come from the film.

use nalgebra::{Isometry3, Vector3};

use crate::colour::BANDS;
use crate::error::{Error, check_positive, check_range};
use crate::paint::{Paint, Substrate};

/// One burst on a bare, flat card.
///
/// The card's frame is that of its picture: origin in the middle of the grid, x along the rows to the right, y along the columns downwards, z into
/// the card. The nozzle's is x along its axis, y to its left, z up.
#[derive(Debug, Clone, PartialEq)]
pub struct Burst {
    /// Where the nozzle stood; its tip has a negative z on the card.
    pub card_from_nozzle: Isometry3<f64>,
    /// How long the valve was told to be open, s.
    pub duration: f64,
    /// Readings in a row of the grid.
    pub columns: usize,
    /// Distance of neighbouring readings on the card, m; at most a quarter of the spot's smaller deviation, because a reading stands for the
    /// middle of its square.
    pub pixel: f64,
    /// Row by row, and the channels of each pixel together: thicknesses in metres (one channel), or reflectances as the [`Coating`] says.
    pub readings: Vec<f64>,
}

/// What the channels of a reading are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Response {
    /// Red, green and blue of linear sRGB, 0..=1 from black to the white of the light.
    LinearSrgb,
    /// The reflectance of one band.
    Band(usize),
}

/// A known paint on the known card, and how it is seen. Readings and coefficients are without the air's interface
/// ([`crate::km::saunderson_inverse`]).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coating {
    /// The paint that was sprayed.
    pub paint: Paint,
    /// The bare card.
    pub card: Substrate,
    /// What was read.
    pub response: Response,
}

impl Coating {
    pub(super) fn check(&self) -> Result<(), Error> {
        match self.response {
            Response::Band(band) if band >= BANDS => {
                Err(Error::OutOfRange { what: "band of a reading", value: band as f64, allowed: "0 to 35" })
            }
            _ => Ok(()),
        }
    }
}

impl Burst {
    /// Refuses what is no picture of a burst.
    pub(super) fn check(&self, channels: usize) -> Result<(), Error> {
        check_positive("duration of a burst", self.duration)?;
        check_range("pixel of a burst", self.pixel, 1e-7, 1.0, "between 0.1 um and 1 m on the card")?;
        let pose = self.card_from_nozzle;
        if !pose.translation.vector.iter().chain(pose.rotation.coords.iter()).all(|v| v.is_finite()) {
            return Err(Error::NotFinite { what: "pose of a burst's nozzle", index: 0 });
        }
        check_range(
            "distance of a burst's nozzle from the card",
            -pose.translation.z,
            1e-4,
            1e3,
            "before the card, m",
        )?;
        let aim = (pose.rotation * Vector3::x()).z;
        check_range("cosine of a nozzle's axis and the card's normal", aim, 0.1, 1.1, "above 0.1: aim at the card")?;
        let row = self.columns.saturating_mul(channels);
        if self.readings.is_empty() || self.columns == 0 {
            return Err(Error::Empty { what: "readings of a burst" });
        }
        if !self.readings.len().is_multiple_of(row) {
            let expected = self.readings.len().div_ceil(row).saturating_mul(row);
            return Err(Error::WrongLength { what: "readings of a burst", expected, found: self.readings.len() });
        }
        match self.readings.iter().position(|v| !v.is_finite()) {
            Some(index) => Err(Error::NotFinite { what: "reading of a burst", index }),
            None => Ok(()),
        }
    }
}
