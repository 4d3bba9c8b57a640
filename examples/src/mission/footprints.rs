//! What sprays leave on the surface itself: painters plan on the plane of its charts.

use paint_net::painters::SurfaceFootprint;
use paint_net::path::Stroke;
use paint_net::{Spray, SprayKernel};
use paint_planner::Target;
use paint_planner::mission::{spray_cell, upright};
use paint_sim::{Film, Shot, SprayModel};
use std::cell::OnceCell;

use super::error::MissionError;
use super::nozzle::{kernel, shot, spot_area, spray_model, sprays};
use super::settings::MissionSettings;
use crate::appearance::UNIT_THICKNESS;
use crate::surface::PaintSurface;

/// Gauss points of order two on -1/2..1/2: `+- 1/sqrt(12)`.
const GAUSS: f64 = 0.288_675_134_594_812_9;

/// The simulated nozzle before the surface, upright over the way through the cell of every spray.
pub(super) struct Footprints<'a> {
    surface: &'a PaintSurface,
    film: Film,
    /// Pixel of every texel of the film.
    pixels: Vec<usize>,
    kernel: SprayKernel,
    model: SprayModel,
    settings: &'a MissionSettings,
    /// Why the simulation refused, if it did: a painter's closure cannot say so.
    refused: OnceCell<paint_sim::Error>,
}

impl<'a> Footprints<'a> {
    pub(super) fn new(surface: &'a PaintSurface, settings: &'a MissionSettings) -> Result<Self, MissionError> {
        let (texels, pixels) = surface.film_texels();
        let (kernel, model) = (kernel(settings)?, spray_model(settings));
        let film = Film::new(texels)?;
        // Settings are refused here, not in the middle of a plan.
        film.shares(&[], &model, &surface.world, settings.threads)?;
        Ok(Self { surface, film, pixels, kernel, model, settings, refused: OnceCell::new() })
    }

    /// Depth on each pixel per unit of a spray's volume, stroke by stroke; nothing for a spray that finds no surface under it. A spray is the way
    /// through its cell: two shots at the Gauss points spread as far.
    pub(super) fn of(&self, strokes: &[Stroke]) -> Vec<SurfaceFootprint> {
        let mut footprints = self.on_texels(strokes);
        footprints.iter_mut().flatten().for_each(|(k, _)| *k = self.pixels[*k as usize] as u32);
        footprints
    }

    /// The same on the texels of the film.
    pub(super) fn on_texels(&self, strokes: &[Stroke]) -> Vec<SurfaceFootprint> {
        let texel = self.settings.texel;
        let volume = self.kernel.mass() * texel * texel;
        let stand_off = self.settings.planner.nozzle.stand_off;
        let shot = |[start, end]: &[Target; 2], share: f64| {
            shot(&upright([start, end], share, stand_off), 0.5 * volume * UNIT_THICKNESS)
        };
        let spacing = self.settings.limits.spray_spacing as f64;
        let on_surface = |stroke: &Stroke| {
            let sprays = sprays(stroke, &self.kernel, self.settings);
            (0..sprays.len()).map(move |k| spray_cell(self.surface, &sprays, k, spacing))
        };
        let cells: Vec<Option<[Target; 2]>> = strokes.iter().flat_map(on_surface).collect();
        let shots: Vec<Shot> =
            cells.iter().flatten().flat_map(|cell| [0.5 - GAUSS, 0.5 + GAUSS].map(|share| shot(cell, share))).collect();
        let shares = match self.film.shares(&shots, &self.model, &self.surface.world, self.settings.threads) {
            Ok(shares) => shares,
            Err(error) => {
                self.refused.get_or_init(|| error);
                return Vec::new();
            }
        };
        let mut of_cells = shares.chunks(2);
        let footprint = |(cell, spray): (&Option<[Target; 2]>, &Spray)| {
            let own = cell.as_ref().and_then(|_| of_cells.next()).unwrap_or_default();
            let paint = 0.5 * spot_area(spray, &self.kernel, texel);
            let depth = |&(k, share): &(u32, f64)| (k, (share * paint / self.film.texels()[k as usize].area) as f32);
            own.iter().flatten().map(depth).collect()
        };
        cells.iter().zip(strokes.iter().flat_map(|stroke| &stroke.sprays)).map(footprint).collect()
    }

    /// What a painter has found, unless the simulation refused it footprints.
    pub(super) fn checked<T>(self, painted: Result<T, paint_net::Error>) -> Result<T, MissionError> {
        match self.refused.into_inner() {
            Some(error) => Err(error.into()),
            None => Ok(painted?),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::test_panel;
    use super::*;

    /// On a flat wall a unit of volume leaves `exp(-r² / 2 σ²)` of the spray's own spread: its whole, and its width across the stroke.
    #[test]
    fn a_wider_spray_leaves_a_wider_spot_of_the_same_depth() {
        let settings = MissionSettings { threads: 1, ..MissionSettings::default() };
        let surface = test_panel::surface();
        let footprints = Footprints::new(&surface, &settings).unwrap();
        let sigma = footprints.kernel.sigma();
        let columns = surface.width();
        let middle = [0.5 * columns as f64, 0.5 * surface.height() as f64];
        for spread in [1.0, 0.6, 1.4] {
            let spray = Spray { x: middle[0], y: middle[1], volume: 1.0, sigma: spread * sigma };
            let stroke = Stroke { sprays: vec![spray] };
            let found = footprints.of(&[stroke]).remove(0);
            let sum = |of: &dyn Fn(f64) -> f64| -> f64 {
                found.iter().map(|&(k, depth)| f64::from(depth) * of((k as usize / columns) as f64)).sum()
            };
            let whole = sum(&|_| 1.0);
            let row = sum(&|y| y) / whole;
            let width = (sum(&|y| (y - row).powi(2)) / whole).sqrt();
            let expected = std::f64::consts::TAU * (spread * sigma).powi(2);
            assert!((whole / expected - 1.0).abs() < 0.02, "{spread}: {whole} {expected}");
            assert!((width / (spread * sigma) - 1.0).abs() < 0.03, "{spread}: {width} {}", spread * sigma);
        }
    }
}
