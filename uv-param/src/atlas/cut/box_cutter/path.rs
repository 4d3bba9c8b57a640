//! A seam across a part, along edges of the mesh.

use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};

use super::part::{Part, Sheet};

/// How much costlier than in place an edge is that lies one width beside the chord; more by the square of the distance.
const ASIDE: f64 = 2.0;
/// Widths beside the chord up to which a path may go.
const BAND: f64 = 4.0;
/// Share of its length that an edge of the rim costs: it is no new seam, but leads nowhere.
const RIM: f64 = 0.3;

/// The cheapest path (Dijkstra's algorithm) between two vertices of a part, near the chord between them: its half-edges inside the part. `None` where
/// none is near enough.
pub(super) fn path(sheet: &Sheet, part: &Part, [from, to]: [u32; 2], width: f64) -> Option<Vec<u32>> {
    let [p, q] = [from, to].map(|v| sheet.at(v));
    let along = [q[0] - p[0], q[1] - p[1]];
    let length = along[0].hypot(along[1]);
    let aside = |v: u32| {
        let at = sheet.at(v);
        ((at[0] - p[0]) * along[1] - (at[1] - p[1]) * along[0]).abs() / (length * width)
    };
    // Cost of the way, and its last half-edge.
    let mut known: HashMap<u32, (f64, u32)> = HashMap::from([(from, (0.0, u32::MAX))]);
    // Bits of floats that are not negative sort like the floats.
    let mut queue = BinaryHeap::from([Reverse((0.0_f64.to_bits(), from))]);
    while let Some(Reverse((bits, v))) = queue.pop() {
        let so_far = f64::from_bits(bits);
        if v == to {
            break;
        }
        if known.get(&v).is_some_and(|(cost, _)| so_far > *cost) {
            continue;
        }
        let corners = sheet.corners(v).iter().filter(|&&corner| sheet.part(corner) == part.name);
        // The half-edges that leave the vertex and those that arrive: an edge of the rim has only one of the two.
        for h in corners.flat_map(|&leaving| [leaving, leaving / 3 * 3 + (leaving + 2) % 3]) {
            let ends = sheet.ends(h);
            let other = if ends[0] == v { ends[1] } else { ends[0] };
            let far = aside(other);
            if far > BAND {
                continue;
            }
            let [a, b] = ends.map(|v| sheet.at(v));
            let cost = if sheet.is_inner(h) { sheet.cost(h) } else { RIM * (a[0] - b[0]).hypot(a[1] - b[1]) };
            let through = so_far + cost * (1.0 + ASIDE * far * far);
            let best = known.entry(other).or_insert((f64::INFINITY, u32::MAX));
            if through < best.0 {
                *best = (through, h);
                queue.push(Reverse((through.to_bits(), other)));
            }
        }
    }
    let (mut found, mut v) = (Vec::new(), to);
    while v != from {
        let h = known.get(&v)?.1;
        if sheet.is_inner(h) {
            found.push(h);
        }
        let ends = sheet.ends(h);
        v = if ends[0] == v { ends[1] } else { ends[0] };
    }
    Some(found)
}
