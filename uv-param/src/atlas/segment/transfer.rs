//! Charts of a coarse surface as charts of the fine one that it was made of.

use nalgebra::Vector3;

use crate::atlas::charts::Charts;
use crate::half_edges::grouped;

/// Sides of an edge whose coarse faces are no neighbours are apart if they lie further from each other than this share of a coarse edge.
const APART: f64 = 0.5;
/// Rounds in which faces that are cut off from their chart go to a neighbour.
const ROUNDS: usize = 4;
/// No face.
const NONE: u32 = u32::MAX;

/// Puts every face of `fine` that is in no chart yet into the chart of the nearest face of `coarse`, turned into the plane of that face and
/// stretched as it is. Faces do not meet at their corners: it is the shape of each that says how it should lie. `roots` has the coarse vertex
/// for every fine one.
pub(in crate::atlas) fn transfer(coarse: &Charts, roots: &[u32], fine: &mut Charts) {
    let surface = fine.surface;
    let planes: Vec<Plane> = (0..coarse.surface.faces().len()).map(|f| Plane::new(coarse, f)).collect();
    let around = Around::new(coarse);
    let prisms: Vec<Prism> = (0..planes.len()).map(|f| Prism::new(coarse, f)).collect();
    let free: Vec<bool> = fine.chart.iter().map(|&c| c == NONE).collect();
    let mut nearest: Vec<u32> = (0..free.len())
        .map(|f| {
            if !free[f] {
                return NONE;
            }
            let [a, b, c] = surface.corners(f).map(Vector3::from);
            around.nearest(coarse, &prisms, roots[surface.faces()[f][0] as usize], (a + b + c) / 3.0)
        })
        .collect();
    let edges = 3 * planes.len();
    let length = (0..edges).map(|h| coarse.surface.edge(h).norm()).sum::<f64>() / edges as f64;
    let first = fine.members.len() as u32;
    let mut changed: Vec<usize> = (0..free.len()).filter(|&f| free[f]).collect();
    for _ in 0..ROUNDS {
        for &f in &changed {
            let near = nearest[f] as usize;
            fine.chart[f] = first + coarse.chart[near];
            let unfolded = planes[near].unfold(surface.corners(f).map(Vector3::from));
            fine.corner_uv[3 * f..3 * f + 3].copy_from_slice(&unfolded);
        }
        let next = |h: usize| h / 3 * 3 + (h + 1) % 3;
        for h in changed.iter().flat_map(|&f| 3 * f..3 * f + 3) {
            let Some(twin) = surface.twin(h) else { continue };
            let sides = [nearest[h / 3], nearest[twin / 3]];
            let cut = fine.chart[h / 3] == fine.chart[twin / 3]
                && parted(coarse, sides).unwrap_or_else(|| {
                    let uv = &fine.corner_uv;
                    let middle = |h: usize| [0, 1].map(|k| 0.5 * (uv[h][k] + uv[next(h)][k]));
                    let (one, other) = (middle(h), middle(twin));
                    (one[0] - other[0]).hypot(one[1] - other[1]) > APART * length
                });
            (fine.cut[h], fine.cut[twin]) = (cut, cut);
        }
        changed = adopt(fine, &free, &mut nearest);
        if changed.is_empty() {
            break;
        }
    }
    fine.members.resize(first as usize + coarse.members.len(), Vec::new());
    for f in (0..free.len()).filter(|&f| free[f]) {
        fine.members[fine.chart[f] as usize].push(f as u32);
    }
}

/// Whether a seam lies between two coarse faces with a common vertex, on the shorter way around it; `None` without one.
fn parted(coarse: &Charts, [f, g]: [u32; 2]) -> Option<bool> {
    if f == g {
        return Some(false);
    }
    let surface = coarse.surface;
    let (f, g) = (f as usize, g as usize);
    if let Some(h) = (3 * f..3 * f + 3).find(|&h| surface.twin(h).is_some_and(|twin| twin / 3 == g)) {
        return Some(coarse.is_seam(h));
    }
    let corners = surface.faces()[g];
    let k = surface.faces()[f].iter().position(|v| corners.contains(v))?;
    let previous = |h: usize| h / 3 * 3 + (h + 2) % 3;
    // The faces between the two and whether a seam was crossed, turning one way and the other.
    let walk = |clockwise: bool| {
        let mut leaving = 3 * f + k;
        let mut crossed = false;
        for steps in 1.. {
            let over = if clockwise { leaving } else { previous(leaving) };
            let twin = surface.twin(over)?;
            crossed |= coarse.is_seam(over);
            if twin / 3 == g {
                return Some((steps, crossed));
            }
            if twin / 3 == f {
                return None;
            }
            leaving = if clockwise { twin / 3 * 3 + (twin + 1) % 3 } else { twin };
        }
        None
    };
    [walk(true), walk(false)].into_iter().flatten().min().map(|(_, crossed)| crossed)
}

/// Gives what is cut off from the largest piece of its chart to the piece beside it; returns these faces.
fn adopt(charts: &Charts, free: &[bool], nearest: &mut [u32]) -> Vec<usize> {
    let surface = charts.surface;
    let mut piece = vec![NONE; free.len()];
    let mut sizes: Vec<(u32, u32)> = Vec::new();
    for start in (0..free.len()).filter(|&f| free[f]) {
        if piece[start] != NONE {
            continue;
        }
        let number = sizes.len() as u32;
        piece[start] = number;
        let mut stack = vec![start];
        let mut size = 0;
        while let Some(f) = stack.pop() {
            size += 1;
            for h in (3 * f..3 * f + 3).filter(|&h| !charts.is_seam(h)) {
                if let Some(other) = surface.twin(h).map(|twin| twin / 3)
                    && piece[other] == NONE
                {
                    piece[other] = number;
                    stack.push(other);
                }
            }
        }
        sizes.push((charts.chart[start], size));
    }
    let mut largest = vec![(0, NONE); charts.chart.iter().max().map_or(0, |&c| c as usize + 1)];
    for (number, &(chart, size)) in sizes.iter().enumerate() {
        let best = &mut largest[chart as usize];
        if size > best.0 {
            *best = (size, number as u32);
        }
    }
    let stays = |f: usize| largest[charts.chart[f] as usize].1 == piece[f];
    let mut settled: Vec<bool> = (0..free.len()).map(|f| free[f] && stays(f)).collect();
    let mut front: Vec<usize> = (0..free.len()).filter(|&f| settled[f]).collect();
    let (mut at, mut adopted) = (0, Vec::new());
    while let Some(&f) = front.get(at) {
        at += 1;
        for h in 3 * f..3 * f + 3 {
            if let Some(other) = surface.twin(h).map(|twin| twin / 3)
                && free[other]
                && !settled[other]
            {
                settled[other] = true;
                nearest[other] = nearest[f];
                front.push(other);
                adopted.push(other);
            }
        }
    }
    adopted
}

/// The plane of a coarse face, and where it lies in its chart.
struct Plane {
    origin: Vector3<f64>,
    normal: Vector3<f64>,
    axes: [Vector3<f64>; 2],
    corner: [f64; 2],
    /// The two edges from that corner.
    edges: [[f64; 2]; 2],
}

impl Plane {
    fn new(charts: &Charts, f: usize) -> Self {
        let [a, b, c] = charts.surface.corners(f).map(Vector3::from);
        let (p, q) = (b - a, c - a);
        let (pp, pq, qq) = (p.dot(&p), p.dot(&q), q.dot(&q));
        let det = (pp * qq - pq * pq).max(f64::MIN_POSITIVE);
        let axes = [(p * qq - q * pq) / det, (q * pp - p * pq) / det];
        let uv = [0, 1, 2].map(|k| charts.corner_uv[3 * f + k]);
        let edges = [1, 2].map(|k: usize| [uv[k][0] - uv[0][0], uv[k][1] - uv[0][1]]);
        Self { origin: a, normal: unit(p.cross(&q)), axes, corner: uv[0], edges }
    }

    /// A direction, projected onto the plane, in the chart.
    fn along(&self, direction: Vector3<f64>) -> [f64; 2] {
        let [s, t] = self.axes.map(|axis| axis.dot(&direction));
        [0, 1].map(|k| s * self.edges[0][k] + t * self.edges[1][k])
    }

    /// Corners of a face near the plane, turned about its centre into the plane on the shortest way, in the chart.
    fn unfold(&self, corners: [Vector3<f64>; 3]) -> [[f64; 2]; 3] {
        let normal = unit((corners[1] - corners[0]).cross(&(corners[2] - corners[0])));
        let (axis, cosine) = (normal.cross(&self.normal), normal.dot(&self.normal));
        let centre = corners.iter().sum::<Vector3<f64>>() / 3.0;
        let at = self.along(centre - self.origin);
        corners.map(|corner| {
            let arm = corner - centre;
            // Rodrigues; a face that looks the other way has no shortest way, and stays as it is.
            let about = if cosine > -0.99 { axis * (axis.dot(&arm) / (1.0 + cosine)) } else { arm * (1.0 - cosine) };
            let turned = self.along(arm * cosine + axis.cross(&arm) + about);
            [0, 1].map(|k| self.corner[k] + at[k] + turned[k])
        })
    }
}

fn unit(v: Vector3<f64>) -> Vector3<f64> {
    v.try_normalize(0.0).unwrap_or_else(Vector3::z)
}

/// The faces around every vertex.
struct Around {
    starts: Vec<u32>,
    faces: Vec<u32>,
}

impl Around {
    fn new(charts: &Charts) -> Self {
        let faces = charts.surface.faces();
        let corners = (0..3 * faces.len()).map(|h| (faces[h / 3][h % 3], h as u32 / 3));
        let (starts, faces) = grouped(charts.surface.positions().len(), corners);
        Self { starts, faces }
    }

    fn of(&self, v: u32) -> &[u32] {
        &self.faces[self.starts[v as usize] as usize..self.starts[v as usize + 1] as usize]
    }

    /// The face nearest to a point, going downhill from those around a vertex.
    fn nearest(&self, charts: &Charts, prisms: &[Prism], start: u32, point: Vector3<f64>) -> u32 {
        let mut best = (f64::INFINITY, NONE);
        let mut from = [start; 3];
        loop {
            let before = best.1;
            for v in from {
                for &f in self.of(v).iter().filter(|&&f| f != before) {
                    let found = prisms[f as usize].squared_distance(point, best.0);
                    if found < best.0 || found <= best.0 && f < best.1 {
                        best = (found, f);
                    }
                }
            }
            if best.1 == before {
                return before;
            }
            from = charts.surface.faces()[best.1 as usize];
        }
    }
}

/// A triangle and what lies above and below it.
struct Prism {
    corners: [Vector3<f64>; 3],
    normal: Vector3<f64>,
    /// Unit normals of the sides, inwards.
    inwards: [Vector3<f64>; 3],
}

impl Prism {
    fn new(charts: &Charts, f: usize) -> Self {
        let corners = charts.surface.corners(f).map(Vector3::from);
        let normal = unit((corners[1] - corners[0]).cross(&(corners[2] - corners[0])));
        let inwards = [0, 1, 2].map(|k| unit(normal.cross(&(corners[(k + 1) % 3] - corners[k]))));
        Self { corners, normal, inwards }
    }

    /// Squared distance of a point from the triangle, or something not below `limit` if it is not below that.
    fn squared_distance(&self, point: Vector3<f64>, limit: f64) -> f64 {
        let height = (point - self.corners[0]).dot(&self.normal);
        let outside = [0, 1, 2].map(|k| self.inwards[k].dot(&(self.corners[k] - point)));
        let farthest = outside[0].max(outside[1]).max(outside[2]).max(0.0);
        let least = height * height + farthest * farthest;
        if farthest == 0.0 || least >= limit {
            return least;
        }
        let to_edge = |k: usize| {
            let edge = self.corners[(k + 1) % 3] - self.corners[k];
            let t = ((point - self.corners[k]).dot(&edge) / edge.norm_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
            (point - self.corners[k] - t * edge).norm_squared()
        };
        to_edge(0).min(to_edge(1)).min(to_edge(2))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::Surface;

    /// A tube of 12 x 4 quads as one chart, cut open along a line, handed to itself: the cut is the same, and every face lies where it did.
    #[test]
    fn a_chart_that_meets_itself_at_a_cut_is_cut_on_the_fine_surface() {
        let (around, along) = (12_u32, 4_u32);
        let angle = |i: u32| std::f64::consts::TAU * f64::from(i) / f64::from(around);
        let at = |i: u32, j: u32| j * around + i % around;
        let (mut positions, mut faces) = (Vec::new(), Vec::new());
        for (j, i) in (0..=along).flat_map(|j| (0..around).map(move |i| (j, i))) {
            positions.push([angle(i).cos(), angle(i).sin(), 0.5 * f64::from(j)]);
            if j < along {
                faces.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
                faces.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
            }
        }
        let (surface, _) = Surface::new(&positions, &faces, true).unwrap();
        let none = vec![false; 3 * faces.len()];
        let (mut coarse, mut fine) = (Charts::new(&surface, none.clone()), Charts::new(&surface, none));
        coarse.members = vec![(0..faces.len() as u32).collect()];
        coarse.chart.fill(0);
        let chord = 2.0 * (0.5 * angle(1)).sin();
        for (f, face) in faces.iter().enumerate() {
            let column = f as u32 / 2 % around;
            for (k, &v) in face.iter().enumerate() {
                let i = if v % around == column { column } else { column + 1 };
                coarse.corner_uv[3 * f + k] = [chord * f64::from(i), positions[v as usize][2]];
                let [a, b] = surface.ends(3 * f + k);
                coarse.cut[3 * f + k] = a % around == 0 && b % around == 0 && surface.twin(3 * f + k).is_some();
            }
        }
        assert_eq!(coarse.cut.iter().filter(|cut| **cut).count(), 2 * along as usize);
        let roots: Vec<u32> = (0..positions.len() as u32).collect();
        transfer(&coarse, &roots, &mut fine);
        assert_eq!(fine.cut, coarse.cut);
        for (here, there) in fine.corner_uv.iter().zip(&coarse.corner_uv) {
            assert!((0..2).all(|k| (here[k] - there[k]).abs() < 1e-12), "{here:?} {there:?}");
        }
    }
}
