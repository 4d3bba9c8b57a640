//! Droplets on a GPU: the same casts as on the processor, for densities and for path simulation.

mod casts;
mod density;
mod device;
mod hits;
mod options;

pub use density::GpuDensity;
pub use hits::GpuHits;
pub use options::GpuOptions;
