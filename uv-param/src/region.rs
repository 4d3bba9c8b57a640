//! Parts of a mesh, to be laid out or painted alone: what goes on from a face without a crease, what lies inside of a border, and
//! which parts are too small to matter.
//!
//! Meshes are those of files: nothing welded, nothing repaired. Vertices at the same place count as one.

mod creases;
mod divide;
mod parts;

pub use creases::{DEFAULT_MEMORY_M, grow_to_creases};
pub use divide::{Division, EditableMesh, EditableUv, Sample, divide_at_border, samples_of_face};
pub use parts::{SmallParts, drop_small_parts};

use std::collections::HashMap;

use nalgebra::Vector3;

use crate::error::Error;

/// Refuses faces that name vertices which do not exist.
fn check(positions: &[[f32; 3]], faces: &[[u32; 3]]) -> Result<(), Error> {
    let vertices = positions.len();
    for (face, corners) in faces.iter().enumerate() {
        if let Some(&index) = corners.iter().find(|&&v| v as usize >= vertices) {
            return Err(Error::IndexOutOfRange { face, index, vertices });
        }
    }
    Ok(())
}

/// For every vertex the first one at the same place: files double vertices along texture seams.
fn same_places(positions: &[[f32; 3]]) -> Vec<u32> {
    let mut first: HashMap<[u32; 3], u32> = HashMap::with_capacity(positions.len());
    // Zero has two bit patterns.
    let key = |p: &[f32; 3]| p.map(|c| (c + 0.0).to_bits());
    positions.iter().enumerate().map(|(k, p)| *first.entry(key(p)).or_insert(k as u32)).collect()
}

/// Half the cross product of two sides of every triangle: along its normal, as long as its area.
fn area_vectors(positions: &[[f32; 3]], faces: &[[u32; 3]]) -> impl Iterator<Item = Vector3<f64>> {
    faces.iter().map(|face| {
        let [a, b, c] = face.map(|i| Vector3::from(positions[i as usize].map(f64::from)));
        0.5 * (b - a).cross(&(c - a))
    })
}
