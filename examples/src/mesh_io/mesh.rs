//! A triangle mesh as it stands in a file.

use nalgebra::Vector3;
use uv_param::surface::file_frame::Unit;

use super::material::MeshMaterials;

/// A triangle mesh as it stands in a file: nothing welded, nothing repaired. Lengths in the file's unit.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TriangleMesh {
    /// Vertex positions, relative to `origin`.
    pub positions: Vec<[f32; 3]>,
    /// What to add to a position for the coordinates of the file: zero but for meshes far from the origin of their coordinates.
    pub origin: [f64; 3],
    /// Metres per unit, where the file says so.
    pub unit: Option<f64>,
    /// Direction that points up, where the file or its format says so.
    pub up: Option<[f64; 3]>,
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

    /// Least and largest coordinates of the vertices that faces use, relative to the origin.
    pub fn bounds(&self) -> ([f32; 3], [f32; 3]) {
        let used = self.faces.iter().flatten().map(|&i| self.positions[i as usize]);
        used.fold(([f32::MAX; 3], [f32::MIN; 3]), |(low, high), p| {
            ([0, 1, 2].map(|c| low[c].min(p[c])), [0, 1, 2].map(|c| high[c].max(p[c])))
        })
    }

    /// The same in the coordinates of the file.
    pub fn bounds_in_file(&self) -> ([f64; 3], [f64; 3]) {
        let (low, high) = self.bounds();
        // The shortest decimal of a position, not the digits behind it.
        let decimal = |c: f32| c.to_string().parse().unwrap_or(f64::from(c));
        let in_file = |p: [f32; 3]| [0, 1, 2].map(|c| decimal(p[c]) + self.origin[c]);
        (in_file(low), in_file(high))
    }

    /// Half the cross product of two sides of every triangle: along its normal, as long as its area.
    pub(crate) fn area_vectors(&self) -> impl Iterator<Item = Vector3<f64>> + '_ {
        self.faces.iter().map(|face| {
            let [a, b, c] = face.map(|i| Vector3::from(self.positions[i as usize].map(f64::from)));
            0.5 * (b - a).cross(&(c - a))
        })
    }
}

/// A mesh while its file is read: positions in double precision still.
#[derive(Default)]
pub(super) struct Parsed {
    pub(super) mesh: TriangleMesh,
    pub(super) points: Vec<[f64; 3]>,
}

impl Parsed {
    /// Takes unit and up axis from a comment that names them: `units: mm`; ours is `metres, z up` or `unit 0.001 m, y up`.
    pub(super) fn read_comment(&mut self, comment: &str) {
        let words: Vec<&str> = comment.split([' ', ',', '\t']).filter(|w| !w.is_empty()).collect();
        let (unit, up) = match words[..] {
            ["metres", axis, "up"] => (Some(1.0), direction(axis)),
            ["unit", metres, "m", axis, "up"] => (metres.parse().ok().filter(|m: &f64| *m > 0.0), direction(axis)),
            _ => (Unit::in_comment(comment).map(Unit::metres), None),
        };
        self.mesh.unit = self.mesh.unit.or(unit);
        self.mesh.up = self.mesh.up.or(up);
    }
}

fn direction(axis: &str) -> Option<[f64; 3]> {
    Some(match axis {
        "x" => [1.0, 0.0, 0.0],
        "y" => [0.0, 1.0, 0.0],
        "z" => [0.0, 0.0, 1.0],
        _ => return None,
    })
}

/// Splits a polygon into a fan of triangles about its first corner.
pub(super) fn fan<T: Copy>(corners: &[T], mut triangle: impl FnMut([T; 3])) {
    for k in 1..corners.len().saturating_sub(1) {
        triangle([corners[0], corners[k], corners[k + 1]]);
    }
}
