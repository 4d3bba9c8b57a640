//! What depth of which paint a pixel would need if it could be painted alone.

use super::Wall;
use crate::palette::MOST_PAINTS;

/// Turns over all paints.
const TURNS: usize = 8;
/// Absorbances are told apart down to this reflectance.
const DARKEST: f64 = 1e-3;

impl Wall<'_> {
    /// Brings the depths of every pixel near its colour: by coordinate descent on absorbances, where paints simply add up.
    pub(super) fn unmix(&mut self) {
        let (bare, count) = (self.palette.wall(), self.palette.paints().len());
        let absorbance = |band: usize, colour: f64| (bare[band].max(DARKEST) / colour.max(DARKEST)).ln();
        // Absorbance of unit depth of each paint.
        let density: Vec<[f64; 3]> = (0..count)
            .map(|p| {
                let mut one = [0.0; MOST_PAINTS];
                one[p] = 1.0;
                let painted = self.palette.colour(&one);
                std::array::from_fn(|band| absorbance(band, painted[band]))
            })
            .collect();
        for (k, depths) in self.depths.iter_mut().enumerate() {
            let wanted = self.wanted.data[k];
            // An absorbance counts by the change of colour that it makes.
            let weight: [f64; 3] = std::array::from_fn(|band| {
                let squared: f64 = self.measures[k].iter().map(|row| row[band] * row[band]).sum();
                squared * wanted[band].max(0.02).powi(2)
            });
            let mut rest: [f64; 3] = std::array::from_fn(|band| absorbance(band, wanted[band]));
            for _ in 0..TURNS {
                for (depth, density) in depths.iter_mut().zip(&density) {
                    let dot = |other: &[f64; 3]| (0..3).map(|b| weight[b] * density[b] * other[b]).sum::<f64>();
                    let bend = dot(density);
                    let now = if bend > 0.0 { (*depth + dot(&rest) / bend).clamp(0.0, self.deepest) } else { 0.0 };
                    (0..3).for_each(|band| rest[band] -= (now - *depth) * density[band]);
                    *depth = now;
                }
            }
        }
    }

    /// By how much the colour of pixel `k` changes, squared, per unit depth of each paint.
    pub(super) fn bends(&self, k: usize) -> [f64; MOST_PAINTS] {
        let mut slopes = [[0.0; 3]; MOST_PAINTS];
        self.palette.film(&self.depths[k], &mut slopes[..self.palette.paints().len()]);
        slopes.map(|slope| {
            let along = |row: &[f64; 3]| (0..3).map(|b| row[b] * slope[b]).sum::<f64>().powi(2);
            self.weight(k) * self.measures[k].iter().map(along).sum::<f64>()
        })
    }
}
