//! The surface that is painted: ray casts and distances.

mod beam;
mod hull;
mod mesh;
mod packet;
mod projection;
mod ray_grid;
mod ray_query;
mod shadow_packet;
mod sheared_ray;

pub use mesh::TriangleSurface;
pub use ray_query::{Hit, Surface};
