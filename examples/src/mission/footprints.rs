//! What sprays leave on the surface itself: painters plan on the plane of its charts.

use paint_net::SprayKernel;
use paint_net::painters::SurfaceFootprint;
use paint_net::path::Stroke;
use paint_planner::Target;
use paint_sim::{Film, Shot, SprayModel};

use super::error::MissionError;
use super::nozzle::{kernel, spray_model, upright_shot};
use super::settings::MissionSettings;
use crate::appearance::UNIT_THICKNESS;
use crate::surface::PaintSurface;
use crate::targets::cell;

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
}

impl<'a> Footprints<'a> {
    pub(super) fn new(surface: &'a PaintSurface, settings: &'a MissionSettings) -> Result<Self, MissionError> {
        let (texels, pixels) = surface.film_texels();
        let (kernel, model) = (kernel(settings)?, spray_model(settings));
        let film = Film::new(texels)?;
        // Settings are refused here, not in the middle of a plan.
        film.shares(&[], &model, &surface.world, settings.threads)?;
        Ok(Self { surface, film, pixels, kernel, model, settings })
    }

    /// Depth on each pixel per unit of a spray's volume, stroke by stroke; nothing for a spray that finds no surface under it. A spray is the way
    /// through its cell: two shots at the Gauss points spread as far.
    pub(super) fn of(&self, strokes: &[Stroke]) -> Vec<SurfaceFootprint> {
        let texel = self.settings.texel;
        let volume = self.kernel.mass() * texel * texel;
        let stand_off = self.settings.planner.nozzle.stand_off;
        let shot = |[start, end]: &[Target; 2], share: f64| {
            upright_shot([start, end], share, stand_off, 0.5 * volume * UNIT_THICKNESS)
        };
        let spacing = self.settings.limits.spray_spacing as f64;
        let on_surface = |stroke: &Stroke, k: usize| cell(self.surface, &stroke.sprays, k, spacing);
        let cells: Vec<Option<[Target; 2]>> =
            strokes.iter().flat_map(|stroke| (0..stroke.sprays.len()).map(move |k| on_surface(stroke, k))).collect();
        let shots: Vec<Shot> =
            cells.iter().flatten().flat_map(|cell| [0.5 - GAUSS, 0.5 + GAUSS].map(|share| shot(cell, share))).collect();
        let shares = self.film.shares(&shots, &self.model, &self.surface.world, self.settings.threads);
        let shares = shares.unwrap_or_default();
        let mut of_cells = shares.chunks(2);
        let depth = |&(k, share): &(u32, f64)| {
            let k = k as usize;
            (self.pixels[k] as u32, (0.5 * share * volume / self.film.texels()[k].area) as f32)
        };
        let footprint = |cell: &Option<[Target; 2]>| {
            let own = cell.as_ref().and_then(|_| of_cells.next()).unwrap_or_default();
            own.iter().flatten().map(depth).collect()
        };
        cells.iter().map(footprint).collect()
    }
}
