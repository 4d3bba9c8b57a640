//! Whether the boundary of a layout crosses itself: a layout without flips whose boundary does not, and whose holes are not turned
//! inside out, is injective.

use crate::chart::overlapping_pairs;
use crate::disk::Disk;
use crate::triangle::orientation;

/// How two edges of a boundary lie.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Contact {
    /// Apart, or with a common end.
    None,
    /// They share a point, as the two sides of a slit in a flat piece do.
    Touch,
    /// Each has the other on both sides.
    Cross,
}

/// Whether the layout, which has no flips, covers nothing twice.
pub(in crate::atlas) fn boundary_is_simple(disk: &Disk, uv: &[[f64; 2]]) -> bool {
    let mut edges: Vec<[u32; 2]> = Vec::new();
    for vertices in &disk.loops {
        edges.extend(vertices.iter().zip(vertices.iter().cycle().skip(1)).map(|(&a, &b)| [a, b]));
    }
    let at = |v: u32| uv[v as usize];
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    let mut length = 0.0;
    for &[a, b] in &edges {
        for k in 0..2 {
            low[k] = low[k].min(at(a)[k]);
            high[k] = high[k].max(at(a)[k]);
            length += (at(a)[k] - at(b)[k]).abs();
        }
    }
    if !length.is_finite() || length == 0.0 {
        return false;
    }
    // Cells of about the length of an edge, but no more of them than there are edges.
    let count = edges.len() as f64;
    let cell = (length / count).max(((high[0] - low[0]) * (high[1] - low[1]) / (4.0 * count)).sqrt());
    let columns = ((high[0] - low[0]) / cell) as usize + 1;
    let rows = ((high[1] - low[1]) / cell) as usize + 1;
    let cells_of = |[a, b]: [u32; 2]| {
        let index = |x: f64, k: usize| ((x - low[k]) / cell) as usize;
        let span = |k: usize| index(at(a)[k].min(at(b)[k]), k)..=index(at(a)[k].max(at(b)[k]), k);
        let columns_of = span(0);
        span(1).flat_map(move |row| columns_of.clone().map(move |column| row * columns + column))
    };
    let mut starts = vec![0u32; columns * rows + 1];
    for &edge in &edges {
        cells_of(edge).for_each(|cell| starts[cell + 1] += 1);
    }
    for cell in 0..columns * rows {
        starts[cell + 1] += starts[cell];
    }
    let mut cursor = starts.clone();
    let mut members = vec![0u32; starts[columns * rows] as usize];
    for (i, &edge) in edges.iter().enumerate() {
        cells_of(edge).for_each(|cell| {
            members[cursor[cell] as usize] = i as u32;
            cursor[cell] += 1;
        });
    }
    let mut touches = false;
    for cell in 0..columns * rows {
        let here = &members[starts[cell] as usize..starts[cell + 1] as usize];
        for (i, &e) in here.iter().enumerate() {
            for &f in &here[i + 1..] {
                match contact(edges[e as usize], edges[f as usize], uv) {
                    Contact::None => {}
                    Contact::Touch => touches = true,
                    Contact::Cross => return false,
                }
            }
        }
    }
    // What only touches may still pass through a corner, and a hole that is turned inside out lies under the faces around it: only
    // the outer loop may run counter-clockwise. Otherwise the faces are asked.
    let outer = disk.loops.iter().filter(|vertices| doubled_area(vertices, uv) > 0.0).count();
    (!touches && outer == 1) || overlapping_pairs(uv, &disk.faces) == 0
}

/// Twice the area inside a closed line, positive if it runs counter-clockwise.
fn doubled_area(vertices: &[u32], uv: &[[f64; 2]]) -> f64 {
    let from_first = |v: u32| [0, 1].map(|k| uv[v as usize][k] - uv[vertices[0] as usize][k]);
    let pairs = vertices.windows(2).map(|pair| [from_first(pair[0]), from_first(pair[1])]);
    pairs.map(|[p, q]| p[0] * q[1] - p[1] * q[0]).sum()
}

/// What two edges have in common beside an end.
fn contact([a, b]: [u32; 2], [c, d]: [u32; 2], uv: &[[f64; 2]]) -> Contact {
    let at = |v: u32| uv[v as usize];
    let (pa, pb, pc, pd) = (at(a), at(b), at(c), at(d));
    let boxes_apart = (0..2).any(|k| pa[k].max(pb[k]) < pc[k].min(pd[k]) || pc[k].max(pd[k]) < pa[k].min(pb[k]));
    if boxes_apart {
        return Contact::None;
    }
    let sides = |p, q, r, s| orientation([p, q, r]) * orientation([p, q, s]);
    let (one, other) = (sides(pa, pb, pc, pd), sides(pc, pd, pa, pb));
    if a == d || b == c || a == c || b == d {
        // Neighbours along the boundary: only folding back onto each other counts.
        let (common, one, other) = if a == d {
            (pa, pb, pc)
        } else if b == c {
            (pb, pa, pd)
        } else {
            return Contact::Touch;
        };
        let along = |p: [f64; 2]| [p[0] - common[0], p[1] - common[1]];
        let (p, q) = (along(one), along(other));
        let folded = orientation([common, one, other]) == 0.0 && p[0] * q[0] + p[1] * q[1] > 0.0;
        return if folded { Contact::Touch } else { Contact::None };
    }
    if one < 0.0 && other < 0.0 {
        Contact::Cross
    } else if one <= 0.0 && other <= 0.0 {
        Contact::Touch
    } else {
        Contact::None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::{FaceLookup, Surface};
    use crate::triangle::flips;

    #[test]
    fn edges_cross_touch_or_are_apart() {
        let between = |edges: [[[f64; 2]; 2]; 2]| {
            let both = [contact([0, 1], [2, 3], &edges.concat()), contact([2, 3], [0, 1], &edges.concat())];
            assert_eq!(both[0], both[1]);
            both[0]
        };
        let level = [[0.0, 0.0], [2.0, 0.0]];
        assert_eq!(between([level, [[1.0, -1.0], [1.0, 1.0]]]), Contact::Cross);
        assert_eq!(between([level, [[1.0, 0.0], [1.5, 1.0]]]), Contact::Touch);
        assert_eq!(between([level, [[1.0, 0.0], [3.0, 0.0]]]), Contact::Touch);
        // The line of one goes through the other, and not the other way round: boxes overlap, edges do not.
        assert_eq!(between([[[0.0, 0.0], [2.0, 2.0]], [[1.5, 0.5], [3.0, -1.0]]]), Contact::None);
        assert_eq!(between([[[0.0, 0.0], [2.0, 2.0]], [[1.0, 0.5], [1.5, 0.0]]]), Contact::None);
        // Boxes that meet at one number only, and boxes that do not.
        assert_eq!(between([level, [[2.0, -1.0], [2.0, 1.0]]]), Contact::Touch);
        assert_eq!(between([level, [[2.1, -1.0], [2.1, 1.0]]]), Contact::None);
    }

    #[test]
    fn neighbours_meet_only_where_they_fold_back() {
        let uv = |end: [f64; 2]| vec![[0.0, 0.0], [1.0, 0.0], end];
        for (end, expected) in [([0.5, 0.0], Contact::Touch), ([2.0, 0.0], Contact::None), ([0.5, 0.5], Contact::None)]
        {
            assert_eq!(contact([0, 1], [1, 2], &uv(end)), expected, "{end:?}");
            assert_eq!(contact([1, 2], [0, 1], &uv(end)), expected, "{end:?}");
        }
    }

    /// A square with a triangular hole, of which one corner is pulled over the opposite side: no face flips and no edges cross, but
    /// the faces at that corner lie on the face beyond the side.
    #[test]
    fn a_hole_turned_inside_out_is_seen() {
        let flat = |height: f64| {
            vec![[-3.0, -3.0], [3.0, -3.0], [3.0, 3.0], [-3.0, 3.0], [-1.0, 0.0], [1.0, 0.0], [0.0, height]]
        };
        let faces = [[0, 1, 5], [0, 5, 4], [1, 2, 5], [5, 2, 6], [2, 3, 6], [3, 4, 6], [3, 0, 4]];
        let positions: Vec<[f64; 3]> = flat(0.5).iter().map(|&[x, y]| [x, y, 0.0]).collect();
        let (surface, _) = Surface::new(&positions, &faces, true).unwrap();
        let all: Vec<u32> = (0..7).collect();
        let disk = surface.disk(&all, |_| false, &mut FaceLookup::new(&surface)).unwrap();
        assert!(boundary_is_simple(&disk, &flat(0.5)));
        assert_eq!(flips(&flat(-0.3), &disk.faces), 0);
        assert!(!boundary_is_simple(&disk, &flat(-0.3)));
    }
}
