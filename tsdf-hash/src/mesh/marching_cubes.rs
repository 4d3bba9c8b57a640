//! The 256 cases of marching cubes, derived rather than tabulated.
//!
//! On each face of a cell the surface is cut along segments. Walking round a face, seen from outside the cell, one enters
//! the solid at some edges and leaves it at others; each entry is joined to the next exit. So every run of solid corners
//! is cut off on its own, by a rule that looks at the four corners of the face only: the two cells that share a face
//! agree, and the surface closes. Every cut edge is an entry on one of its two faces and an exit on the other, so the
//! segments link up into closed loops, and these are filled with triangles whose inner edges never lie in a face.

use std::sync::LazyLock;

use crate::mesh::lattice::corner;

/// Corner `c` of a cell is at `(c & 1, c >> 1 & 1, c >> 2)`; an edge is named by its lower corner and its axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Edge {
    corner: usize,
    axis: usize,
}

impl Edge {
    fn between(a: usize, b: usize) -> Self {
        Self { corner: a & b, axis: (a ^ b).trailing_zeros() as usize }
    }

    /// Whether both edges lie in one face of the cell.
    fn shares_face(self, other: Self) -> bool {
        (0..3).any(|axis| {
            self.axis != axis && other.axis != axis && (self.corner >> axis & 1) == (other.corner >> axis & 1)
        })
    }
}

/// The surface in a cell.
pub(crate) struct Case {
    /// The cut edges: the name of the lower corner, as seen from the cell's lowest, and the axis.
    pub(crate) edges: Vec<u16>,
    /// Counter-clockwise triangles, seen from the free side, between these edges.
    pub(crate) triangles: Vec<[u8; 3]>,
}

/// The cell of each case; bit `c` of a case is set where corner `c` is solid.
pub(crate) static CASES: LazyLock<Vec<Case>> =
    LazyLock::new(|| (0..256).map(|case| Case::of(&triangles(case))).collect());

impl Case {
    fn of(triangles: &[[Edge; 3]]) -> Self {
        let mut edges: Vec<Edge> = Vec::new();
        let mut number = |edge: Edge| {
            let known = edges.iter().position(|&other| other == edge);
            known.unwrap_or_else(|| {
                edges.push(edge);
                edges.len() - 1
            }) as u8
        };
        let triangles = triangles.iter().map(|triangle| triangle.map(&mut number)).collect();
        let name = |edge: &Edge| corner([edge.corner & 1, edge.corner >> 1 & 1, edge.corner >> 2]) + edge.axis;
        let edges = edges.iter().map(|edge| name(edge) as u16).collect();
        Self { edges, triangles }
    }
}

/// The triangles of a case, counter-clockwise seen from the free side.
fn triangles(case: usize) -> Vec<[Edge; 3]> {
    loops(case).iter().flat_map(|polygon| fill(polygon)).collect()
}

/// The four corners of a face, counter-clockwise from outside the cell.
fn face(axis: usize, upper: usize) -> [usize; 4] {
    let (a, b) = (1 << ((axis + 1) % 3), 1 << ((axis + 2) % 3));
    let base = upper << axis;
    if upper == 1 { [base, base + a, base + a + b, base + b] } else { [base, base + b, base + a + b, base + a] }
}

/// The closed polygons in which the surface cuts a cell.
fn loops(case: usize) -> Vec<Vec<Edge>> {
    let solid = |corner: usize| case >> corner & 1 == 1;
    let mut segments: Vec<(Edge, Edge)> = Vec::new();
    for axis in 0..3 {
        for upper in 0..2 {
            let corners = face(axis, upper);
            for k in 0..4 {
                let (before, after) = (corners[k], corners[(k + 1) % 4]);
                if solid(before) || !solid(after) {
                    continue;
                }
                let mut last = k + 1;
                while solid(corners[(last + 1) % 4]) {
                    last += 1;
                }
                let exit = Edge::between(corners[last % 4], corners[(last + 1) % 4]);
                segments.push((Edge::between(before, after), exit));
            }
        }
    }
    let mut polygons = Vec::new();
    while let Some((first, mut at)) = segments.pop() {
        let mut polygon = vec![first];
        while at != first {
            polygon.push(at);
            let Some(next) = segments.iter().position(|&(from, _)| from == at) else { break };
            at = segments.swap_remove(next).1;
        }
        polygons.push(polygon);
    }
    polygons
}

/// Triangulates a polygon with diagonals that lie inside the cell, so that no neighbour can have the same one.
fn fill(polygon: &[Edge]) -> Vec<[Edge; 3]> {
    inner_fill(polygon).unwrap_or_default()
}

fn inner_fill(polygon: &[Edge]) -> Option<Vec<[Edge; 3]>> {
    let (first, last) = (polygon[0], polygon[polygon.len() - 1]);
    if polygon.len() == 2 {
        return Some(Vec::new());
    }
    for apex in 1..polygon.len() - 1 {
        let allowed = (apex == 1 || !first.shares_face(polygon[apex]))
            && (apex + 2 == polygon.len() || !last.shares_face(polygon[apex]));
        if !allowed {
            continue;
        }
        if let (Some(mut left), Some(right)) = (inner_fill(&polygon[..=apex]), inner_fill(&polygon[apex..])) {
            left.push([first, polygon[apex], last]);
            left.extend(right);
            return Some(left);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::{Edge, loops, triangles};

    #[test]
    fn every_loop_is_filled_and_every_cut_edge_is_used() {
        for case in 0..256_usize {
            let polygons = loops(case);
            let count: usize = polygons.iter().map(|p| p.len() - 2).sum();
            assert_eq!(triangles(case).len(), count, "case {case:08b}");
            let mut cut = Vec::new();
            for a in 0..8_usize {
                for b in [a | 1, a | 2, a | 4].into_iter().filter(|&b| b != a) {
                    if (case >> a ^ case >> b) & 1 == 1 {
                        cut.push(Edge::between(a, b));
                    }
                }
            }
            let corners: Vec<Edge> = polygons.concat();
            assert_eq!(corners.len(), cut.len());
            assert!(cut.iter().all(|edge| corners.contains(edge)));
        }
    }

    #[test]
    fn a_single_solid_corner_gives_one_triangle_facing_away_from_it() {
        for corner in 0..8_usize {
            let [triangle] = triangles(1 << corner)[..] else { panic!("one triangle") };
            let at = |edge: &Edge| {
                let mut p = [0, 1, 2].map(|k| f64::from((edge.corner >> k & 1) as u8));
                p[edge.axis] = 0.5;
                nalgebra::Vector3::from(p)
            };
            let [a, b, c] = [0, 1, 2].map(|k| at(&triangle[k]));
            let solid = nalgebra::Vector3::from([0, 1, 2].map(|k| f64::from((corner >> k & 1) as u8)));
            assert!((b - a).cross(&(c - a)).dot(&(a - solid)) > 0.0);
        }
    }

    /// The rule itself, on random corners: the surface around any set of solid voxels is closed and oriented.
    #[test]
    fn random_solids_have_closed_surfaces() {
        const SIDE: usize = 9;
        let cases: Vec<_> = (0..256).map(triangles).collect();
        for seed in 0..20_u64 {
            // Solid with a probability of a half inside, free at the border.
            let solid = |p: [usize; 3]| {
                let inside = p.iter().all(|&c| c > 0 && c < SIDE);
                let word = (p[0] + 16 * (p[1] + 16 * p[2])) as u64;
                inside && crate::hashing::mix64(seed * 65536 + word + 1) & 1 == 1
            };
            let mut half_edges = std::collections::BTreeMap::new();
            for cell in 0..SIDE * SIDE * SIDE {
                let cell = [cell % SIDE, cell / SIDE % SIDE, cell / (SIDE * SIDE)];
                let corner = |c: usize| [0, 1, 2].map(|k| cell[k] + (c >> k & 1));
                let case = (0..8).fold(0, |case, c| case | usize::from(solid(corner(c))) << c);
                for triangle in &cases[case] {
                    let name = triangle.map(|edge| (corner(edge.corner), edge.axis));
                    for k in 0..3 {
                        *half_edges.entry((name[k], name[(k + 1) % 3])).or_insert(0) += 1;
                    }
                }
            }
            assert!(half_edges.len() > 1000);
            for (&(a, b), &count) in &half_edges {
                assert_eq!((count, half_edges.get(&(b, a))), (1, Some(&1)));
            }
        }
    }
}
