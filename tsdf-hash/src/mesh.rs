//! The surface as a welded triangle mesh.

mod cases;
mod keeper;
mod obj;
mod patch;
mod ply;
mod rows;
mod weld;

pub use keeper::{MeshKeeper, MeshReport};
pub use obj::write_obj;
pub use ply::write_ply;

use crate::Map;

/// A triangle mesh; `positions`, `normals` and `colours` have one entry per vertex, and no two vertices belong to the
/// same voxel edge.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Vertices in the world, metres.
    pub positions: Vec<[f32; 3]>,
    /// Triangles, counter-clockwise seen from the free side (where the camera was).
    pub faces: Vec<[u32; 3]>,
    /// Unit normals into the free side: the mean of the neighbouring triangles, by area.
    pub normals: Vec<[f32; 3]>,
    /// R, G, B; mid-grey where no colour was seen.
    pub colours: Vec<[u8; 3]>,
}

impl Map {
    /// The zero level of the field by marching cubes, where all eight voxels of a cell have been observed and the distance
    /// does not jump; of the blocks in active memory. [`MeshKeeper`] has that of all tiers, and follows a map that changes.
    ///
    /// Vertices and faces come in the order of the block coordinates, so equal maps give equal meshes. The sign test is
    /// "solid where the distance is below zero". Every edge has at most two faces.
    pub fn mesh(&self) -> Mesh {
        MeshKeeper::of_active(self.store(), &patch::Scale::new(self.settings()))
    }
}
