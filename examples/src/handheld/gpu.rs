//! The density on a GPU.

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
    _surface: &'a TexelSurface,
    _droplets: &Droplets,
) -> Result<Box<dyn DensityDevice + 'a>, HandheldError> {
    let must_be = "not there yet";
    Err(HandheldError::Option { option: "--gpu", value: 1.0, must_be })
}
