//! A triangle mesh as it stands in a file.

use nalgebra::Vector3;

use super::material::MeshMaterials;

/// A triangle mesh as it stands in a file: nothing welded, nothing repaired. Lengths in the file's unit.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TriangleMesh {
    /// Vertex positions.
    pub positions: Vec<[f32; 3]>,
    /// Vertex indices, three per triangle; polygons are fanned.
    pub faces: Vec<[u32; 3]>,
    /// Colours per vertex, sRGB in `[0, 1]`, where the file has them.
    pub colours: Option<Vec<[f32; 3]>>,
    /// Texture coordinates with indices of their own, where the file has them.
    pub uv: Option<MeshUv>,
    /// Colours and pictures that the file names for its faces, where it does.
    pub materials: Option<MeshMaterials>,
    /// What was assumed or left aside while the file was read, to be told.
    pub notes: Vec<String>,
}

/// Texture coordinates: indices separate from the vertices'.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct MeshUv {
    /// Coordinates; v = 1 is the top row of the image.
    pub coordinates: Vec<[f32; 2]>,
    /// Indices into `coordinates`, three per triangle.
    pub faces: Vec<[u32; 3]>,
}

impl TriangleMesh {
    /// The corners of a face; its indices must be valid.
    pub fn corners(&self, face: usize) -> [[f32; 3]; 3] {
        self.faces[face].map(|vertex| self.positions[vertex as usize])
    }

    /// Sum of the areas of its triangles, in the square of its unit; indices must be valid.
    pub fn area(&self) -> f64 {
        self.area_vectors().map(|vector| vector.norm()).sum()
    }

    /// Least and largest coordinates of the vertices that faces use.
    pub fn bounds(&self) -> ([f32; 3], [f32; 3]) {
        let used = self.faces.iter().flatten().map(|&i| self.positions[i as usize]);
        used.fold(([f32::MAX; 3], [f32::MIN; 3]), |(low, high), p| {
            ([0, 1, 2].map(|c| low[c].min(p[c])), [0, 1, 2].map(|c| high[c].max(p[c])))
        })
    }

    /// Half the cross product of two sides of every triangle: along its normal, as long as its area.
    pub(crate) fn area_vectors(&self) -> impl Iterator<Item = Vector3<f64>> + '_ {
        self.faces.iter().map(|face| {
            let [a, b, c] = face.map(|i| Vector3::from(self.positions[i as usize].map(f64::from)));
            0.5 * (b - a).cross(&(c - a))
        })
    }
}

/// Splits a polygon into a fan of triangles about its first corner.
pub(super) fn fan<T: Copy>(corners: &[T], mut triangle: impl FnMut([T; 3])) {
    for k in 1..corners.len().saturating_sub(1) {
        triangle([corners[0], corners[k], corners[k + 1]]);
    }
}
