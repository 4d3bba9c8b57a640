//! All that goes on from a face without a crease.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use nalgebra::{Point3, Vector3};

use super::parts::neighbours;
use super::{area_vectors, check};
use crate::error::Error;

/// Rounds of smoothing: scans are rough at the size of their faces.
const ROUNDS: usize = 4;
/// How different neighbouring normals may be and still be averaged (Zheng et al. 2011, Eq. (3): sigma of the normals).
const SIGMA: f64 = 0.35;
/// Cosine of the angle between a face and what lies before it on the way, above which there is a crease: 25 degrees.
const CREASE: f64 = 0.906;
/// Way over which "what lies before" is averaged, metres (ours): maps round their creases by a few centimetres. A pillar thinner than half a
/// metre has no end of creases then.
pub const DEFAULT_MEMORY_M: f64 = 0.12;

/// A face that can be reached, the nearest first.
#[derive(PartialEq)]
struct Step {
    way: f64,
    face: u32,
    from: u32,
}

impl Eq for Step {}

impl Ord for Step {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.way.total_cmp(&other.way).then(self.face.cmp(&other.face)).then(self.from.cmp(&other.from))
    }
}

impl PartialOrd for Step {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

/// The faces that are reached from `seed` without a crease, the nearest first. A crease is where the normal leaves the mean of the
/// normals on the way, which forgets over `memory` (units of the mesh): a sharp edge, and one that a map has rounded, but not a
/// surface that bends slowly. Says of every face whether it was reached.
///
/// # Errors
/// [`Error::IndexOutOfRange`]; [`Error::Setting`] for a seed that is no face, and for a memory below 0.
pub fn grow_to_creases(
    positions: &[[f32; 3]],
    faces: &[[u32; 3]],
    seed: usize,
    memory: f64,
) -> Result<Vec<bool>, Error> {
    check(positions, faces)?;
    if seed >= faces.len() {
        return Err(Error::Setting { name: "seed", value: seed as f64, must_be: "the number of a face" });
    }
    if !(memory >= 0.0 && memory.is_finite()) {
        return Err(Error::Setting { name: "memory", value: memory, must_be: "finite and at least 0" });
    }
    let pairs = neighbours(positions, faces);
    let normals = filtered_normals(positions, faces, &pairs);
    let centre = |f: u32| {
        let corners = faces[f as usize].map(|i| Vector3::from(positions[i as usize].map(f64::from)));
        Point3::from(corners.iter().sum::<Vector3<f64>>() / 3.0)
    };
    let mut around = vec![Vec::new(); faces.len()];
    for [a, b] in pairs {
        around[a as usize].push(b);
        around[b as usize].push(a);
    }
    let mut before: Vec<Option<Vector3<f64>>> = vec![None; faces.len()];
    let mut open = BinaryHeap::from([Reverse(Step { way: 0.0, face: seed as u32, from: seed as u32 })]);
    while let Some(Reverse(Step { way, face, from })) = open.pop() {
        if before[face as usize].is_some() {
            continue;
        }
        let normal = normals[face as usize];
        let mean = before[from as usize].unwrap_or(normal);
        if normal.dot(&mean) < CREASE && face != from {
            continue;
        }
        let step = (centre(face) - centre(from)).norm();
        let share = step / (step + memory);
        before[face as usize] = Some((mean * (1.0 - share) + normal * share).try_normalize(0.0).unwrap_or(mean));
        for &next in &around[face as usize] {
            let way = way + (centre(next) - centre(face)).norm();
            open.push(Reverse(Step { way, face: next, from: face }));
        }
    }
    Ok(before.iter().map(Option::is_some).collect())
}

/// Bilaterally filtered normals: averaged where they are alike, kept apart across a crease.
fn filtered_normals(positions: &[[f32; 3]], faces: &[[u32; 3]], pairs: &[[u32; 2]]) -> Vec<Vector3<f64>> {
    let areas: Vec<Vector3<f64>> = area_vectors(positions, faces).collect();
    let mut normals: Vec<Vector3<f64>> = areas.iter().map(|a| a.try_normalize(0.0).unwrap_or_default()).collect();
    for _ in 0..ROUNDS {
        let mut next: Vec<Vector3<f64>> = normals.iter().zip(&areas).map(|(n, a)| n * a.norm()).collect();
        for [a, b] in pairs.iter().map(|pair| pair.map(|f| f as usize)) {
            let alike = (-(normals[a] - normals[b]).norm_squared() / (2.0 * SIGMA * SIGMA)).exp();
            next[a] += normals[b] * (alike * areas[b].norm());
            next[b] += normals[a] * (alike * areas[a].norm());
        }
        normals = next.into_iter().map(|n| n.try_normalize(0.0).unwrap_or_default()).collect();
    }
    normals
}
