//! The paper's object: a cube of 60 mm on its corner with a circle of 34 mm on each of its upper faces (handheld paper, Fig. 7).

use nalgebra::{Point3, Rotation3, Unit, Vector3};

use super::object::SurfaceSample;
use crate::mesh_io::TriangleMesh;

/// Side of the cube, m.
pub const SIDE: f64 = 0.06;
/// Diameter of the circles, m.
pub const CIRCLE: f64 = 0.034;

/// The mesh: a corner below, the opposite one above, the lowest point at the origin.
pub fn cube() -> TriangleMesh {
    let corners = (0..8_u32).map(|k| Vector3::new(f64::from(k & 1), f64::from(k >> 1 & 1), f64::from(k >> 2)) * SIDE);
    let upright = upright();
    // Counter-clockwise seen from outside.
    let quads: [[u32; 4]; 6] = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    TriangleMesh {
        positions: corners.map(|p| (upright * p).cast::<f32>().into()).collect(),
        faces: quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect(),
        ..TriangleMesh::default()
    }
}

/// Its edges, along which it is cut: a circle is in one piece then.
pub fn cube_edges() -> Vec<[u32; 2]> {
    let pairs = (0..8_u32).flat_map(|a| [1, 2, 4].map(|bit| [a, a | bit]));
    pairs.filter(|[a, b]| a != b).collect()
}

/// Middles and outward normals of the upper faces.
pub fn upper_faces() -> [SurfaceSample; 3] {
    [0, 1, 2].map(|axis| {
        let mut normal = Vector3::zeros();
        normal[axis] = 1.0;
        let middle = Vector3::repeat(0.5 * SIDE) + normal * (0.5 * SIDE);
        SurfaceSample { point: Point3::from(upright() * middle), normal: Unit::new_normalize(upright() * normal) }
    })
}

/// Whether a point of the surface lies in one of the circles.
pub fn in_circle(sample: &SurfaceSample) -> bool {
    upper_faces()
        .iter()
        .any(|face| face.normal.dot(&sample.normal) > 0.99 && (sample.point - face.point).norm() <= 0.5 * CIRCLE)
}

/// Turns the diagonal of a cube along the axes upwards.
fn upright() -> Rotation3<f64> {
    Rotation3::rotation_between(&Vector3::repeat(1.0), &Vector3::z()).unwrap_or_else(Rotation3::identity)
}
