//! The surface that is painted: ray casts and distances.

mod mesh;
mod ray_query;

pub use mesh::TriangleSurface;
pub use ray_query::{Hit, Surface};
