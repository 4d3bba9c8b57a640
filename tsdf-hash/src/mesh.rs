//! The surface as a welded triangle mesh.

pub(crate) mod block_mesh;
mod cell_cases;
mod components;
pub(crate) mod deformation;
mod edge_set;
pub(crate) mod incremental;
mod lattice;
mod marching_cubes;
pub(crate) mod obj;
pub(crate) mod patches;
pub(crate) mod ply;
#[cfg(test)]
mod tests;
pub(crate) mod triangle_mesh;
mod weld;

pub use deformation::EmbeddedDeformation;
pub use incremental::IncrementalMesher;
pub use obj::write_obj;
pub use patches::PatchKey;
pub use ply::write_ply;
pub use triangle_mesh::Mesh;
