//! How much paint is needed where the nozzle could be (handheld paper, Section IV-A).

use super::cast::{Caster, DropletHit};
use super::coverage::Coverage;
use super::directions::Droplets;
use super::sweep::Nozzle;
use super::texel_surface::TexelSurface;

/// What a need for paint is compared with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Flux {
    /// Thickness that is missing, times the distance, over the cosine of the incidence (m^2): what a nozzle at unit distance would have
    /// to spray per length of its path.
    #[default]
    Physical,
    /// Thickness over the squared distance (1/m), as Eq. (1) is printed, with the sign of the prose.
    PaperLiteral,
}

/// How the density is sampled.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct DensitySettings {
    /// Which flux.
    pub flux: Flux,
    /// Threads that share the samples; the values do not depend on it (default 1).
    pub threads: usize,
}

impl Default for DensitySettings {
    fn default() -> Self {
        Self { flux: Flux::Physical, threads: 1 }
    }
}

/// A nozzle whose density is asked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DensityPlace {
    /// Where it would be.
    pub nozzle: Nozzle,
    /// The most that one ray counts, in the unit of the flux: what the nozzle can place in one pass. A ray to a texel with too much then
    /// counts as nothing, like one beside the target: paint does the same harm on both. Infinite in Eq. (1), where it counts as negative.
    pub saturation: f32,
}

/// Required paint density, Eq. (1), of a nozzle at each of the places: the mean over all droplets, those that miss count as zero.
pub fn density_map(
    surface: &TexelSurface,
    coverage: &Coverage,
    droplets: &Droplets,
    places: &[DensityPlace],
    settings: &DensitySettings,
) -> Vec<f32> {
    let mut values = vec![0.0; places.len()];
    let chunk = places.len().div_ceil(settings.threads.max(1)).max(1);
    let run = |places: &[DensityPlace], values: &mut [f32]| {
        let mut caster = Caster::default();
        for (place, value) in places.iter().zip(values) {
            *value = sample(&mut caster, surface, coverage, droplets, place, settings.flux);
        }
    };
    std::thread::scope(|scope| {
        let mut parts = places.chunks(chunk).zip(values.chunks_mut(chunk));
        let first = parts.next();
        for (places, values) in parts {
            scope.spawn(move || run(places, values));
        }
        if let Some((places, values)) = first {
            run(places, values);
        }
    });
    values
}

fn sample(
    caster: &mut Caster,
    surface: &TexelSurface,
    coverage: &Coverage,
    droplets: &Droplets,
    place: &DensityPlace,
    flux: Flux,
) -> f32 {
    let (nozzle, most) = (&place.nozzle, place.saturation);
    let least = if most.is_finite() { 0.0 } else { f32::NEG_INFINITY };
    let (deficit, mut sum) = (coverage.deficit(), 0.0);
    match flux {
        Flux::Physical => caster.cast(surface, nozzle, droplets, |hit: &DropletHit| {
            sum += (deficit[hit.texel as usize] * hit.distance_squared / hit.height).min(most).max(least);
        }),
        Flux::PaperLiteral => caster.cast(surface, nozzle, droplets, |hit: &DropletHit| {
            sum += (deficit[hit.texel as usize] / hit.distance_squared).min(most).max(least);
        }),
    }
    sum / droplets.len() as f32
}
