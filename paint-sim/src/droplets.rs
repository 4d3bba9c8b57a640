//! Droplets as rays: paint need and deposit of a nozzle whose cone is narrow, per texel of a texture (handheld paper, Sections IV-A, V).
//!
//! A [`TexelSurface`] is the mesh with its texture, a [`Coverage`] what is wanted and what is there, a [`Droplets`] set the directions of
//! the spray. [`density_map`] answers how much paint is needed where the nozzle could be (Eq. (1)); a [`PathSimulation`] sprays along
//! paths, step by step, and keeps the valve shut where paint would do harm (Eqs. (6), (7)).

mod candidate;
mod cast;
mod cone;
mod coverage;
mod density;
mod directions;
#[cfg(feature = "gpu")]
mod gpu;
mod path_simulation;
mod step;
mod sweep;
mod texel_surface;

#[cfg(feature = "gpu")]
pub use crate::gpu::GpuOptions;
pub use coverage::{Coverage, CoverageFigures};
pub use density::{DensityPlace, DensitySettings, Flux, density_map};
pub use directions::Droplets;
#[cfg(feature = "gpu")]
pub use gpu::{GpuDensity, GpuHits};
pub use path_simulation::{PathOutcome, PathSimulation, SimulatedSegment};
pub use step::{DepositSettings, StepCast, StepHits, StepOutcome};
pub use sweep::{GantryGeometry, Nozzle, Sweep};
pub use texel_surface::{TexelFace, TexelSurface};
