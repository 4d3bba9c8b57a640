//! What sprays leave on the surface itself: painters plan on the plane of its charts.

use paint_net::SprayKernel;
use paint_net::painters::SurfaceFootprint;
use paint_net::path::Stroke;
use paint_planner::Target;
use paint_planner::mission::{spray_cell, upright};
use paint_sim::{Film, Shot, SprayModel};
use std::cell::OnceCell;

use super::error::MissionError;
use super::nozzle::{kernel, shot, spray_model, sprays};
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
            let sprays = sprays(stroke, &self.kernel, texel);
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
        let depth = |&(k, share): &(u32, f64)| {
            let k = k as usize;
            (k as u32, (0.5 * share * volume / self.film.texels()[k].area) as f32)
        };
        let footprint = |cell: &Option<[Target; 2]>| {
            let own = cell.as_ref().and_then(|_| of_cells.next()).unwrap_or_default();
            own.iter().flatten().map(depth).collect()
        };
        cells.iter().map(footprint).collect()
    }

    /// What a painter has found, unless the simulation refused it footprints.
    pub(super) fn checked<T>(self, painted: Result<T, paint_net::Error>) -> Result<T, MissionError> {
        match self.refused.into_inner() {
            Some(error) => Err(error.into()),
            None => Ok(painted?),
        }
    }
}
