//! The forward model: a spray, its footprint, and how paint depth becomes ink.

mod footprints;
mod kernel;
mod saturation;
mod spray;

pub(crate) use footprints::{FootprintMatrix, cells};
pub use kernel::SprayKernel;
pub use saturation::{MonotoneCurve, Saturation};
pub use spray::Spray;
