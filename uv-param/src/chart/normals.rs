//! Normals that do not jump.

use std::f64::consts::PI;

use nalgebra::Vector3;

use crate::disk::Disk;

/// Unit normals per vertex: face normals weighted by the angle of the face at the vertex, which does not depend on how
/// the surface is cut into triangles. Both sides of a seam share theirs: the surface goes on there.
pub(super) fn vertex_normals(disk: &Disk) -> Vec<Vector3<f64>> {
    let mut normals = vec![Vector3::zeros(); disk.positions.len()];
    for (f, face) in disk.faces.iter().enumerate() {
        let corners = disk.corners(f).map(Vector3::from);
        let normal = disk.face_cross(f).normalize();
        for k in 0..3 {
            let (a, b) = (corners[(k + 1) % 3] - corners[k], corners[(k + 2) % 3] - corners[k]);
            let angle = a.cross(&b).norm().atan2(a.dot(&b));
            normals[disk.uncut_vertex(face[k]) as usize] += angle * normal;
        }
    }
    for normal in &mut normals {
        *normal = normal.try_normalize(f64::EPSILON).unwrap_or_default();
    }
    for v in 0..normals.len() {
        normals[v] = normals[disk.uncut_vertex(v as u32) as usize];
    }
    normals
}

/// Evenly spread points of the disc of this radius: a sunflower spiral (equal areas, golden angle).
pub(super) fn disc(radius: f64) -> impl Iterator<Item = [f64; 2]> {
    const SAMPLES: usize = 128;
    let golden = PI * (3.0 - f64::sqrt(5.0));
    (0..SAMPLES).map(move |i| {
        let r = radius * ((i as f64 + 0.5) / SAMPLES as f64).sqrt();
        let (sin, cos) = (i as f64 * golden).sin_cos();
        [r * cos, r * sin]
    })
}
