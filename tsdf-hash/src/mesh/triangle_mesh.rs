//! A triangle mesh.

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
