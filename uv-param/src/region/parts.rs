//! Parts of a selection that share no edge with the rest of it.

use std::collections::HashMap;

use super::{area_vectors, check, same_places};
use crate::error::Error;

/// What was taken out of a selection.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct SmallParts {
    /// How many parts.
    pub parts: usize,
    /// How many faces they had.
    pub faces: usize,
}

/// Faces on either side of every edge, as pairs; edges with more faces are in several.
pub(super) fn neighbours(positions: &[[f32; 3]], faces: &[[u32; 3]]) -> Vec<[u32; 2]> {
    let joined = same_places(positions);
    let mut last: HashMap<(u32, u32), u32> = HashMap::with_capacity(2 * faces.len());
    let mut pairs = Vec::with_capacity(2 * faces.len());
    for (f, face) in faces.iter().enumerate() {
        for k in 0..3 {
            let [a, b] = [face[k], face[(k + 1) % 3]].map(|v| joined[v as usize]);
            if let Some(other) = last.insert((a.min(b), a.max(b)), f as u32) {
                pairs.push([other, f as u32]);
            }
        }
    }
    pairs
}

/// Takes parts with less than `smallest` area (square units of the mesh) out of a selection of faces.
///
/// # Errors
/// [`Error::IndexOutOfRange`]; [`Error::Length`] where `inside` has not one value per face.
pub fn drop_small_parts(
    positions: &[[f32; 3]],
    faces: &[[u32; 3]],
    inside: &mut [bool],
    smallest: f64,
) -> Result<SmallParts, Error> {
    check(positions, faces)?;
    if inside.len() != faces.len() {
        return Err(Error::Length { what: "inside", expected: faces.len(), found: inside.len() });
    }
    let mut parent: Vec<u32> = (0..faces.len() as u32).collect();
    for [a, b] in neighbours(positions, faces) {
        if inside[a as usize] && inside[b as usize] {
            let [a, b] = [a, b].map(|f| root(&mut parent, f));
            parent[a.max(b) as usize] = a.min(b);
        }
    }
    let mut area = vec![0.0; faces.len()];
    for (f, vector) in area_vectors(positions, faces).enumerate() {
        area[root(&mut parent, f as u32) as usize] += vector.norm();
    }
    let mut small = SmallParts::default();
    for (f, inside) in inside.iter_mut().enumerate().filter(|(_, inside)| **inside) {
        let first = root(&mut parent, f as u32) as usize;
        if area[first] < smallest {
            small.parts += usize::from(first == f);
            small.faces += 1;
            *inside = false;
        }
    }
    Ok(small)
}

fn root(parent: &mut [u32], mut face: u32) -> u32 {
    while parent[face as usize] != face {
        let above = parent[parent[face as usize] as usize];
        parent[face as usize] = above;
        face = above;
    }
    face
}
