//! What sprays leave on the surface itself: painters plan on the plane of its charts.

use paint_net::{Spray, SprayKernel, SurfaceFootprint};
use paint_sim::{Film, Shot, SprayModel};

use super::decide::{kernel, spray_model};
use super::error::MissionError;
use super::settings::MissionSettings;
use crate::appearance::UNIT_THICKNESS;
use crate::surface::PaintSurface;

/// The simulated nozzle before the surface, upright over the place of every spray.
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

    /// Depth on each pixel per unit of a spray's volume; nothing for a spray that finds no surface under it.
    pub(super) fn of(&self, sprays: &[Spray]) -> Vec<SurfaceFootprint> {
        let texel = self.settings.texel;
        let volume = self.kernel.mass() * texel * texel;
        let stand_off = self.settings.planner.nozzle.stand_off;
        let shot = |spray: &Spray| {
            let (point, normal) = self.surface.lift(spray.x, spray.y)?;
            let volume = volume * UNIT_THICKNESS;
            Some(Shot { origin: point + normal.into_inner() * stand_off, axis: -normal, volume })
        };
        let shots: Vec<Option<Shot>> = sprays.iter().map(shot).collect();
        let found: Vec<Shot> = shots.iter().flatten().copied().collect();
        let shares = self.film.shares(&found, &self.model, &self.surface.world, self.settings.threads);
        let mut shares = shares.unwrap_or_default().into_iter();
        let depth = |(k, share): (u32, f64)| {
            (self.pixels[k as usize] as u32, (share * volume / self.film.texels()[k as usize].area) as f32)
        };
        let footprint = |shot: Option<Shot>| {
            let own = shot.and_then(|_| shares.next()).unwrap_or_default();
            own.into_iter().map(depth).collect()
        };
        shots.into_iter().map(footprint).collect()
    }
}
