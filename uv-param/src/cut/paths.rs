//! Where a seam would run: the cheapest path from every vertex to the outer boundary.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use crate::disk::Disk;

/// How much costlier than its length a sharply convex edge is, and how much cheaper a sharply concave one: seams in
/// creases are seen least and disturb a spray least.
const CREASE_FACTOR: f64 = 0.5;
/// Length over which bending counts as sharp, relative to the square root of the area.
const CREASE_LENGTH: f64 = 0.05;
/// End of the paths.
const ROOT: u32 = u32::MAX;

/// A shortest-path tree rooted in the outer boundary.
pub(super) struct BoundaryPaths {
    /// Price of the way out, metres for flat surfaces.
    pub(super) distance: Vec<f64>,
    toward: Vec<u32>,
}

impl BoundaryPaths {
    /// Dijkstra's algorithm. The rims of holes are free: they are cut already, and a path that walks along one opens it.
    pub(super) fn new(disk: &Disk) -> Self {
        let vertices = disk.positions.len();
        let neighbours = Neighbours::new(disk);
        let mut paths = Self { distance: vec![f64::INFINITY; vertices], toward: vec![ROOT; vertices] };
        // Bits of floats that are not negative sort like the floats.
        let mut queue = BinaryHeap::new();
        for &v in &disk.loops[0] {
            paths.distance[v as usize] = 0.0;
            queue.push(Reverse((0.0_f64.to_bits(), v)));
        }
        while let Some(Reverse((bits, v))) = queue.pop() {
            let distance = f64::from_bits(bits);
            if distance > paths.distance[v as usize] {
                continue;
            }
            for &(other, price) in neighbours.of(v) {
                let through = distance + price;
                if through < paths.distance[other as usize] {
                    paths.distance[other as usize] = through;
                    paths.toward[other as usize] = v;
                    queue.push(Reverse((through.to_bits(), other)));
                }
            }
        }
        paths
    }

    /// The vertex with the costliest way out; `None` if all are on the boundary.
    pub(super) fn farthest(&self) -> Option<u32> {
        let inner = (0..self.distance.len()).filter(|&v| self.distance[v] > 0.0);
        inner.max_by(|&a, &b| self.distance[a].total_cmp(&self.distance[b])).map(|v| v as u32)
    }

    /// The vertices from `start` to the outer boundary.
    pub(super) fn from(&self, start: u32) -> Vec<u32> {
        let step = |&v: &u32| Some(self.toward[v as usize]).filter(|&next| next != ROOT);
        std::iter::successors(Some(start), step).collect()
    }
}

/// Priced edges in compressed rows.
struct Neighbours {
    starts: Vec<u32>,
    edges: Vec<(u32, f64)>,
}

impl Neighbours {
    fn new(disk: &Disk) -> Self {
        let vertices = disk.positions.len();
        let sharp = CREASE_LENGTH * disk.area().sqrt();
        let mut list = Vec::with_capacity(2 * disk.twins.len());
        for h in 0..disk.twins.len() {
            let face = disk.faces[h / 3];
            let (a, b) = (face[h % 3], face[(h + 1) % 3]);
            match disk.twin(h) {
                Some(twin) if twin < h => {}
                Some(twin) => list.push((a, b, price(disk, h, twin, sharp))),
                None => list.push((a, b, 0.0)),
            }
        }
        let mut starts = vec![0u32; vertices + 1];
        for &(a, b, _) in &list {
            starts[a as usize + 1] += 1;
            starts[b as usize + 1] += 1;
        }
        for v in 0..vertices {
            starts[v + 1] += starts[v];
        }
        let mut cursor = starts.clone();
        let mut edges = vec![(0, 0.0); 2 * list.len()];
        for (a, b, price) in list {
            for (from, to) in [(a, b), (b, a)] {
                edges[cursor[from as usize] as usize] = (to, price);
                cursor[from as usize] += 1;
            }
        }
        Self { starts, edges }
    }

    fn of(&self, v: u32) -> &[(u32, f64)] {
        &self.edges[self.starts[v as usize] as usize..self.starts[v as usize + 1] as usize]
    }
}

/// Length of an inner edge, costlier on ridges and cheaper in creases. Bending is measured per length, so that the price does
/// not depend on how finely the surface is meshed.
fn price(disk: &Disk, h: usize, twin: usize, sharp: f64) -> f64 {
    let edge = disk.edge(h);
    let length = edge.norm();
    let (left, right) = (disk.face_cross(h / 3), disk.face_cross(twin / 3));
    // Positive where the surface is convex.
    let bend = left.cross(&right).dot(&edge).atan2(length * left.dot(&right));
    let across = (left.norm() + right.norm()) / (3.0 * length);
    length * (1.0 + CREASE_FACTOR * (bend * sharp / across).tanh())
}
