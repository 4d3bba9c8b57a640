//! Doses that leave a wanted thickness: least squares with volumes that are not negative.

use crate::error::{Error, require};

/// What a unit of volume leaves: places, and the thickness on each.
pub type DoseFootprint = Vec<(u32, f64)>;

/// Volumes of sprays whose places are settled, so that the film comes as near a wanted thickness as it can:
///
/// ```text
/// min ½ Σ wᵢ ((S v)ᵢ - yᵢ)²    subject to  0 ≤ vₖ ≤ most,    v ← v · Sᵀ W y / Sᵀ W S v
/// ```
///
/// with footprints as columns of `S`: the image space reconstruction algorithm (Daube-Witherspoon and Muehllehner 1986), whose steps keep
/// every volume positive and never raise the cost. [`OnSurface`](super::OnSurface) fits ink, which saturates; this fits thickness itself,
/// for coats.
#[derive(Debug, Clone, Copy)]
pub struct DoseCorrection<'a> {
    /// One for each spray.
    pub footprints: &'a [DoseFootprint],
    /// Thickness wanted at each place, in the footprints' unit.
    pub wanted: &'a [f64],
    /// Weight of each place: its area, less where it does not matter.
    pub weight: &'a [f64],
    /// Updates. 300 leaves less than a percent of what can be gained.
    pub rounds: usize,
}

impl DoseCorrection<'_> {
    /// Changes `volumes`, which start where they are (0 stays 0), and keeps each below its entry of `most`. A spray that leaves nothing keeps
    /// its volume. Returns the thickness at each place.
    ///
    /// # Errors
    /// Lists of other lengths, places beyond the list, what is negative or not finite.
    pub fn solve(&self, volumes: &mut [f64], most: &[f64]) -> Result<Vec<f64>, Error> {
        self.check(volumes, most)?;
        let asked = self.adjoint(self.wanted);
        for _ in 0..self.rounds {
            let got = self.adjoint(&self.thickness(volumes));
            for (((volume, most), asked), got) in volumes.iter_mut().zip(most).zip(&asked).zip(got) {
                if got > 0.0 {
                    *volume = (*volume * asked / got).min(*most);
                }
            }
        }
        Ok(self.thickness(volumes))
    }

    /// `S v`.
    fn thickness(&self, volumes: &[f64]) -> Vec<f64> {
        let mut thickness = vec![0.0; self.wanted.len()];
        for (footprint, volume) in self.footprints.iter().zip(volumes) {
            for &(place, share) in footprint {
                thickness[place as usize] += share * volume;
            }
        }
        thickness
    }

    /// `Sᵀ W field`.
    fn adjoint(&self, field: &[f64]) -> Vec<f64> {
        let weighted: Vec<f64> = field.iter().zip(self.weight).map(|(value, weight)| value * weight).collect();
        let of = |footprint: &DoseFootprint| footprint.iter().map(|&(k, share)| share * weighted[k as usize]).sum();
        self.footprints.iter().map(of).collect()
    }

    fn check(&self, volumes: &[f64], most: &[f64]) -> Result<(), Error> {
        let same = |what: &'static str, found: usize, expected: usize| {
            if found == expected {
                return Ok(());
            }
            Err(Error::Mismatch { what, found: (found, 1), expected: (expected, 1) })
        };
        same("list of weights", self.weight.len(), self.wanted.len())?;
        same("list of volumes", volumes.len(), self.footprints.len())?;
        same("list of largest volumes", most.len(), self.footprints.len())?;
        let allowed = |value: &f64| *value >= 0.0 && value.is_finite();
        let lists = [("wanted", self.wanted), ("weight", self.weight), ("volumes", volumes), ("most", most)];
        for (name, list) in lists {
            let wrong = list.iter().copied().find(|value| !allowed(value));
            require(name, wrong.unwrap_or(0.0), wrong.is_none(), "it must be 0 or more, and finite")?;
        }
        for (place, share) in self.footprints.iter().flatten() {
            require("footprints", *share, allowed(share), "it must be 0 or more, and finite")?;
            let known = (*place as usize) < self.wanted.len();
            require("footprints", f64::from(*place), known, "it must be a place of the wanted thickness")?;
        }
        Ok(())
    }
}
