//! The surface that is painted: ray casts and distances.

mod beam;
mod mesh;
mod ray_query;
mod shadow_beam;
mod sheared_ray;

pub use mesh::TriangleSurface;
pub use ray_query::{Hit, Surface};
