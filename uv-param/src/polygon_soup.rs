//! A triangle soup as files hold it: what is refused, welded and dropped before anything else is asked of it.

use crate::error::Error;
use crate::half_edges::grouped;
use crate::triangle;

/// A face whose height is below this fraction of its longest edge has no measurable shape: it is the relative rounding
/// of the f32 coordinates that meshes are stored in.
const FLAT: f64 = 1e-7;

/// Beyond this products of lengths overflow; every f32 is below it.
const MAX_COORDINATE: f64 = 1e40;

/// Half-edges are counted in 32 bits.
const MAX_COUNT: usize = (u32::MAX / 6) as usize;

/// Refuses what no later step could name; returns the number of unreferenced vertices.
pub(crate) fn check(positions: &[[f64; 3]], faces: &[[u32; 3]]) -> Result<usize, Error> {
    if positions.is_empty() || faces.is_empty() {
        return Err(Error::Empty);
    }
    let count = positions.len().max(faces.len());
    if count > MAX_COUNT {
        return Err(Error::TooLarge { count, limit: MAX_COUNT });
    }
    let mut used = vec![false; positions.len()];
    for (face, corners) in faces.iter().enumerate() {
        for &index in corners {
            let slot = used.get_mut(index as usize);
            *slot.ok_or(Error::IndexOutOfRange { face, index, vertices: positions.len() })? = true;
        }
    }
    for (vertex, position) in positions.iter().enumerate() {
        if used[vertex] && !position.iter().all(|x| x.abs() <= MAX_COORDINATE) {
            return Err(Error::NonFinite { vertex });
        }
    }
    Ok(used.iter().filter(|&&u| !u).count())
}

/// Points the faces to the first vertex at each position; returns how many vertices lost their faces.
pub(crate) fn weld(positions: &[[f64; 3]], faces: &mut [[u32; 3]]) -> usize {
    // Adding 0.0 makes -0.0 and 0.0 the same bits.
    let key = |v: u32| positions[v as usize].map(|x| (x + 0.0).to_bits());
    let mut order: Vec<u32> = faces.iter().flatten().copied().collect();
    order.sort_unstable();
    order.dedup();
    order.sort_by_key(|&v| (key(v), v));
    let mut first: Vec<u32> = (0..positions.len() as u32).collect();
    let mut merged = 0;
    for pair in order.windows(2) {
        if key(pair[0]) == key(pair[1]) {
            first[pair[1] as usize] = first[pair[0] as usize];
            merged += 1;
        }
    }
    for corner in faces.iter_mut().flatten() {
        *corner = first[*corner as usize];
    }
    merged
}

/// The faces of a soup that have a shape and are not repeated.
pub(crate) struct ShapedFaces {
    /// Their indices, ascending.
    pub(crate) kept: Vec<u32>,
    /// How many have a repeated corner or no area.
    pub(crate) degenerate: usize,
    /// How many have the same three corners as an earlier one.
    pub(crate) duplicate: usize,
}

pub(crate) fn faces_with_shape(positions: &[[f64; 3]], faces: &[[u32; 3]]) -> ShapedFaces {
    let has_shape = |f: &u32| {
        let corners = faces[*f as usize];
        triangle::has_shape(corners.map(|v| positions[v as usize]), FLAT)
    };
    let mut kept: Vec<u32> = (0..faces.len() as u32).filter(has_shape).collect();
    let degenerate = faces.len() - kept.len();
    let by_corners = |&f: &u32| {
        let mut corners = faces[f as usize];
        corners.sort_unstable();
        (corners[0], [corners[1], corners[2], f])
    };
    let (buckets, mut rest) = grouped(positions.len(), kept.iter().map(by_corners));
    let mut repeated = vec![];
    for bucket in buckets.windows(2) {
        let same = &mut rest[bucket[0] as usize..bucket[1] as usize];
        same.sort_unstable();
        repeated.extend(same.windows(2).filter(|pair| pair[0][..2] == pair[1][..2]).map(|pair| pair[1][2]));
    }
    repeated.sort_unstable();
    kept.retain(|f| repeated.binary_search(f).is_err());
    ShapedFaces { kept, degenerate, duplicate: repeated.len() }
}

/// The smallest member of the set that holds `f`, in a forest of parents that never point upwards.
pub(crate) fn find_root(parent: &mut [u32], mut f: u32) -> u32 {
    while parent[f as usize] != f {
        parent[f as usize] = parent[parent[f as usize] as usize];
        f = parent[f as usize];
    }
    f
}
