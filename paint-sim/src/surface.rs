//! The surface that is painted: ray casts and distances.

mod beam;
#[cfg(feature = "gpu")]
mod gpu_surface;
#[cfg(feature = "gpu")]
mod gpu_tree;
mod hull;
mod mesh;
mod packet;
mod projection;
mod ray_grid;
mod ray_query;
mod shadow_packet;
mod sheared_ray;

#[cfg(feature = "gpu")]
pub use crate::gpu::GpuOptions;
#[cfg(feature = "gpu")]
pub use gpu_surface::{GpuRayCount, GpuSurface};
pub use mesh::TriangleSurface;
pub use ray_query::{Hit, ShadowRay, Surface};
