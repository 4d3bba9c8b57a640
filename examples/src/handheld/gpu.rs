//! The density on a GPU.

#[cfg(feature = "gpu")]
use paint_sim::droplets::{Coverage, DensityPlace, Flux, GpuDensity, GpuOptions};
use paint_sim::droplets::{Droplets, TexelSurface};

use super::error::HandheldError;
use super::forecast::DensityDevice;

/// Opens a GPU for an object.
#[cfg(not(feature = "gpu"))]
pub(super) fn open<'a>(
    _surface: &'a TexelSurface,
    _droplets: &Droplets,
) -> Result<Box<dyn DensityDevice + 'a>, HandheldError> {
    let must_be = "needs a build with --features gpu, or leave it out";
    Err(HandheldError::Option { option: "--gpu", value: 1.0, must_be })
}

/// Opens a GPU for an object.
#[cfg(feature = "gpu")]
pub(super) fn open<'a>(
    surface: &'a TexelSurface,
    droplets: &Droplets,
) -> Result<Box<dyn DensityDevice + 'a>, HandheldError> {
    // A program that stands in for a GPU is slower than the processor, but shows that all of it works.
    let options = GpuOptions { software: true, ..GpuOptions::default() };
    Ok(Box::new(Gpu { surface, density: GpuDensity::new(droplets, &options)? }))
}

#[cfg(feature = "gpu")]
struct Gpu<'a> {
    surface: &'a TexelSurface,
    density: GpuDensity,
}

#[cfg(feature = "gpu")]
impl DensityDevice for Gpu<'_> {
    fn density(&mut self, coverage: &Coverage, places: &[DensityPlace], flux: Flux) -> Result<Vec<f32>, HandheldError> {
        Ok(self.density.density_map(self.surface, coverage, places, flux)?)
    }

    fn name(&self) -> String {
        self.density.name().into()
    }
}
