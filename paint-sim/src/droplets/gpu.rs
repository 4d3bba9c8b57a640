//! Droplets on a GPU: the same casts as on the processor, for densities and for path simulation.

mod casts;
mod density;
mod hits;

pub use density::GpuDensity;
pub use hits::GpuHits;
