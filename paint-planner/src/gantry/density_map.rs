//! The required paint density over time and gantry position (handheld paper, Section IV-A, Fig. 2).

use super::model::{GantrySample, PaintModel};
use super::settings::GantrySettings;
use crate::error::Error;

/// Samples on a grid over time and gantry position; only where the nozzle can get in time.
#[derive(Debug, Clone, PartialEq)]
pub struct DensityMap {
    start: f64,
    spacing: [f64; 2],
    rows: Vec<Row>,
}

#[derive(Debug, Clone, PartialEq)]
struct Row {
    /// Index of the first sample: its position is the start plus so many spacings.
    first: i64,
    values: Vec<f32>,
}

impl DensityMap {
    /// Asks the model for the density wherever a nozzle that starts at `position` can be in time.
    ///
    /// # Errors
    /// [`Error::World`] if the model answers with another number of values, or with one that is not finite.
    pub fn sample(model: &mut dyn PaintModel, position: f64, settings: &GantrySettings) -> Result<Self, Error> {
        // Whole numbers of samples to a cell of the fastest movement and to an interval, so that their corners are samples.
        let fit = |length: f64, spacing: f64| length / (length / spacing).round().max(1.0);
        let reach = settings.max_speed * settings.interval;
        let spacing = [fit(reach, settings.density_spacing[0]), fit(settings.interval, settings.density_spacing[1])];
        let count = |length: f64| (length.max(0.0) / spacing[0] - 1e-9).ceil() as i64;
        let (below, above) = (count(position), count(settings.travel - position));
        let layers = (settings.duration() / spacing[1]).round() as usize;
        let mut samples = Vec::new();
        let mut rows = Vec::with_capacity(layers + 1);
        for layer in 0..=layers {
            let time = layer as f64 * spacing[1];
            let farthest = count(settings.max_speed * time);
            let (first, last) = (-below.min(farthest), above.min(farthest));
            rows.push(Row { first, values: vec![0.0; (last - first + 1) as usize] });
            let saturation = if settings.saturate {
                settings.flux_speed / model.cross_speed(time).hypot(0.5 * settings.max_speed)
            } else {
                f64::INFINITY
            };
            samples.extend((first..=last).map(|k| {
                let on_slide = (position + k as f64 * spacing[0]).clamp(0.0, settings.travel);
                GantrySample { time, position: on_slide, saturation }
            }));
        }
        let values = model.required_density(&samples);
        let refuse = |what| Err(Error::World { what, at: [0.0; 3] });
        if values.len() != samples.len() {
            return refuse("the paint model gave another number of densities than it was asked for");
        }
        if values.iter().any(|value| !value.is_finite()) {
            return refuse("the paint model gave a density that is not finite");
        }
        let mut rest = values.as_slice();
        for row in &mut rows {
            let (mine, others) = rest.split_at(row.values.len());
            row.values.copy_from_slice(mine);
            rest = others;
        }
        Ok(Self { start: position, spacing, rows })
    }

    /// The density at a time (s) and gantry position (m), between the samples bilinearly, beyond them that of the nearest.
    pub fn at(&self, time: f64, position: f64) -> f32 {
        let layer = (time / self.spacing[1]).clamp(0.0, (self.rows.len() - 1) as f64);
        let place = (position - self.start) / self.spacing[0];
        let (row, share) = (layer as usize, layer.fract() as f32);
        let low = self.rows[row].at(place);
        if share == 0.0 { low } else { low + share * (self.rows[row + 1].at(place) - low) }
    }

    /// The samples: time (s) and position (m), density.
    pub fn samples(&self) -> impl Iterator<Item = ([f64; 2], f32)> + '_ {
        self.rows.iter().enumerate().flat_map(move |(layer, row)| {
            row.values.iter().enumerate().map(move |(k, value)| {
                let position = self.start + (row.first + k as i64) as f64 * self.spacing[0];
                ([layer as f64 * self.spacing[1], position], *value)
            })
        })
    }

    /// Distance of the samples along the gantry, m, and in time, s.
    pub fn spacing(&self) -> [f64; 2] {
        self.spacing
    }
}

impl Row {
    fn at(&self, place: f64) -> f32 {
        let place = (place - self.first as f64).clamp(0.0, (self.values.len() - 1) as f64);
        let (index, share) = (place as usize, place.fract() as f32);
        let low = self.values[index];
        if share == 0.0 { low } else { low + share * (self.values[index + 1] - low) }
    }
}
