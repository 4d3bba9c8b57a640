//! What every movement of the base tree is worth (handheld paper, Section IV-C, Eqs. (2)-(5)).

use super::density_map::DensityMap;
use super::lattice::{Lattice, Segment};
use super::model::PaintModel;
use super::settings::GantrySettings;

/// Scores of all movements, by layer, cell and speed. Nodes of one cell with different incoming speeds inherit them.
pub(super) struct EdgeScores {
    /// First cell of each layer, and its scores, `directions` for each cell.
    layers: Vec<(i32, Vec<f64>)>,
    fastest: i32,
}

impl EdgeScores {
    pub(super) fn new(
        lattice: &Lattice,
        density: &DensityMap,
        model: &dyn PaintModel,
        settings: &GantrySettings,
    ) -> Self {
        let fastest = lattice.fastest;
        let layers = (0..lattice.horizon)
            .map(|layer| {
                let [first, last] = lattice.reach(layer);
                let middle = (layer as f64 + 0.5) * settings.interval;
                let cross_speed = model.cross_speed(middle);
                let movements = (first..=last).flat_map(|cell| (-fastest..=fastest).map(move |speed| (cell, speed)));
                let scores = movements.map(|(cell, speed)| {
                    if !lattice.stays(cell, speed) {
                        return 0.0;
                    }
                    score(&lattice.segment(layer, cell, speed), density, cross_speed, settings)
                });
                (first, scores.collect())
            })
            .collect();
        Self { layers, fastest }
    }

    pub(super) fn of(&self, layer: usize, cell: i32, speed: i32) -> f64 {
        let (first, scores) = &self.layers[layer];
        let directions = 2 * self.fastest + 1;
        scores[((cell - first) * directions + speed + self.fastest) as usize]
    }
}

/// The mean of the need along a movement, where the flux of the moving nozzle does not exceed it.
fn score(segment: &Segment, density: &DensityMap, cross_speed: f64, settings: &GantrySettings) -> f64 {
    let gantry_speed = (segment.to - segment.from) / segment.duration;
    let nozzle_speed = gantry_speed.hypot(cross_speed); // Eq. (2)
    let flux = settings.flux_speed / nozzle_speed; // Eq. (3); infinite for a nozzle that stands still
    let samples = settings.samples;
    let mut sum = 0.0;
    for i in 0..samples {
        let share = (i as f64 + 0.5) / samples as f64;
        let time = segment.start + share * segment.duration;
        let need = f64::from(density.at(time, segment.from + share * (segment.to - segment.from)));
        if flux * settings.least_use < need {
            sum += need; // Eq. (4)
        }
    }
    sum / samples as f64 // Eq. (5)
}
