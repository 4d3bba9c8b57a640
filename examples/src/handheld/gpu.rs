//! Density and path simulation on a GPU.

#[cfg(feature = "gpu")]
use paint_sim::droplets::{Coverage, DensityPlace, Flux, GpuDensity, GpuHits, GpuOptions, StepCast, StepHits};
use paint_sim::droplets::{Droplets, TexelSurface};

use super::error::HandheldError;
use super::forecast::PaintDevice;

/// Opens a GPU for an object: the rays of the density, and the droplets of the time steps.
#[cfg(not(feature = "gpu"))]
pub(super) fn open<'a>(
    _surface: &'a TexelSurface,
    _density: &Droplets,
    _steps: &[Droplets],
) -> Result<Box<dyn PaintDevice + 'a>, HandheldError> {
    let must_be = "needs a build with --features gpu, or leave it out";
    Err(HandheldError::Option { option: "--gpu", value: 1.0, must_be })
}

/// Opens a GPU for an object: the rays of the density, and the droplets of the time steps.
#[cfg(feature = "gpu")]
pub(super) fn open<'a>(
    surface: &'a TexelSurface,
    density: &Droplets,
    steps: &[Droplets],
) -> Result<Box<dyn PaintDevice + 'a>, HandheldError> {
    // A program that stands in for a GPU is slower than the processor, but shows that all of it works.
    let options = GpuOptions { software: true, ..GpuOptions::default() };
    let (density, hits) = (GpuDensity::new(density, &options)?, GpuHits::new(steps, &options)?);
    Ok(Box::new(Gpu { surface, density, hits }))
}

#[cfg(feature = "gpu")]
struct Gpu<'a> {
    surface: &'a TexelSurface,
    density: GpuDensity,
    hits: GpuHits,
}

#[cfg(feature = "gpu")]
impl PaintDevice for Gpu<'_> {
    fn density(&mut self, coverage: &Coverage, places: &[DensityPlace], flux: Flux) -> Result<Vec<f32>, HandheldError> {
        Ok(self.density.density_map(self.surface, coverage, places, flux)?)
    }

    fn hits(&mut self, steps: &[StepCast]) -> Result<Option<Vec<StepHits>>, HandheldError> {
        Ok(Some(self.hits.cast(self.surface, steps)?))
    }

    fn name(&self) -> String {
        self.density.name().into()
    }
}
