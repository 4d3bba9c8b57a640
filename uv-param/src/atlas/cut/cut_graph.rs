//! The shortest cuts that open a closed part or one with handles, so that it can be laid out whole: loops of a tree-cotree decomposition (Erickson and
//! Whittlesey 2005, "Greedy optimal homotopy and homology generators") from one base; a path from end to end where there is no handle.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use crate::atlas::cut::seam_cost::SeamCosts;
use crate::polygon_soup::find_root;
use crate::surface::Surface;

/// Half-edges, one of each edge, to open in a part (its faces), so that it becomes a disk, perhaps with holes; empty for one that is one.
pub(in crate::atlas) fn cut_graph(surface: &Surface, faces: &[u32], costs: &SeamCosts) -> Vec<u32> {
    let half_edges = || faces.iter().flat_map(|&f| 3 * f..3 * f + 3);
    let has_border = half_edges().any(|h| surface.twin(h as usize).is_none());
    let around = Neighbours::new(surface, half_edges());
    let Some(first) = half_edges().next().map(|h| surface.ends(h as usize)[0]) else { return Vec::new() };
    // An end of the part: loops are short there, and a path leads to the other end.
    let base = around.tree(costs, first).farthest;
    let tree = around.tree(costs, base);

    // Across the edges outside of the tree, those of the longest loops first, the faces are joined; what joins none closes a loop.
    let [from, to] = [0, 1].map(|end| move |h: u32| surface.ends(h as usize)[end]);
    let in_tree = |h: u32| {
        let twin = surface.twin(h as usize).map(|t| t as u32);
        [Some(h), twin]
            .into_iter()
            .flatten()
            .any(|h| tree.last_edge(to(h)) == Some(h) || tree.last_edge(from(h)) == Some(h))
    };
    let mut others: Vec<(f64, u32)> = half_edges()
        .filter(|&h| surface.twin(h as usize).is_some_and(|twin| (h as usize) < twin) && !in_tree(h))
        .map(|h| (tree.distance(from(h)) + tree.distance(to(h)) + costs.of(h), h))
        .collect();
    others.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    let mut root: Vec<u32> = (0..surface.faces().len() as u32).collect();
    let mut cut: Vec<u32> = Vec::new();
    for (_, h) in others {
        let Some(twin) = surface.twin(h as usize) else { continue };
        let [a, b] = [h / 3, twin as u32 / 3].map(|f| find_root(&mut root, f));
        if a == b {
            cut.push(h);
            cut.extend(tree.path(surface, from(h)));
            cut.extend(tree.path(surface, to(h)));
        } else {
            root[a.max(b) as usize] = a.min(b);
        }
    }
    if cut.is_empty() && !has_border {
        cut = tree.path(surface, tree.farthest);
    }
    cut.sort_unstable();
    cut.dedup();
    cut
}

/// Half-edges that leave every vertex.
struct Neighbours<'a> {
    surface: &'a Surface,
    leaving: std::collections::HashMap<u32, Vec<u32>>,
}

/// Shortest paths from a base.
struct Tree {
    /// Distance and last half-edge, towards the vertex, of the path to it.
    reached: std::collections::HashMap<u32, (f64, Option<u32>)>,
    farthest: u32,
}

impl<'a> Neighbours<'a> {
    fn new(surface: &'a Surface, half_edges: impl Iterator<Item = u32>) -> Self {
        let mut leaving: std::collections::HashMap<u32, Vec<u32>> = std::collections::HashMap::new();
        // Along the border there is no cut.
        for h in half_edges.filter(|&h| surface.twin(h as usize).is_some()) {
            leaving.entry(surface.ends(h as usize)[0]).or_default().push(h);
        }
        Self { surface, leaving }
    }

    fn tree(&self, costs: &SeamCosts, base: u32) -> Tree {
        let mut reached = std::collections::HashMap::new();
        let mut farthest = base;
        // Distances are positive: their bits are in order.
        let mut open = BinaryHeap::from([Reverse((0_u64, base, None))]);
        while let Some(Reverse((bits, v, last))) = open.pop() {
            if reached.contains_key(&v) {
                continue;
            }
            let distance = f64::from_bits(bits);
            reached.insert(v, (distance, last));
            farthest = v;
            for &h in self.leaving.get(&v).into_iter().flatten() {
                let next = self.surface.ends(h as usize)[1];
                if !reached.contains_key(&next) {
                    open.push(Reverse(((distance + costs.of(h)).to_bits(), next, Some(h))));
                }
            }
        }
        Tree { reached, farthest }
    }
}

impl Tree {
    fn distance(&self, v: u32) -> f64 {
        self.reached.get(&v).map_or(0.0, |(distance, _)| *distance)
    }

    fn last_edge(&self, v: u32) -> Option<u32> {
        self.reached.get(&v).and_then(|(_, last)| *last)
    }

    /// Half-edges of the path to a vertex, the lower number of each edge.
    fn path(&self, surface: &Surface, mut v: u32) -> Vec<u32> {
        let mut path = Vec::new();
        while let Some(h) = self.last_edge(v) {
            path.push(surface.twin(h as usize).map_or(h, |twin| h.min(twin as u32)));
            v = surface.ends(h as usize)[0];
        }
        path
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A closed grid of `n` x `m` quads on a torus of radii 1 and 0.3.
    fn torus(n: u32, m: u32) -> Surface {
        let mut positions = Vec::new();
        for j in 0..m {
            for i in 0..n {
                let [a, b] =
                    [f64::from(i) / f64::from(n), f64::from(j) / f64::from(m)].map(|t| std::f64::consts::TAU * t);
                let radius = 1.0 + 0.3 * a.cos();
                positions.push([radius * b.cos(), radius * b.sin(), 0.3 * a.sin()]);
            }
        }
        let at = |i: u32, j: u32| (j % m) * n + i % n;
        let quad = |i, j| [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]];
        let faces: Vec<[u32; 3]> = (0..m).flat_map(|j| (0..n).flat_map(move |i| quad(i, j))).collect();
        Surface::new(&positions, &faces, true).unwrap().0
    }

    #[test]
    fn a_torus_is_opened_along_two_loops() {
        let surface = torus(16, 48);
        let faces: Vec<u32> = (0..surface.faces().len() as u32).collect();
        let cut = cut_graph(&surface, &faces, &SeamCosts::new(&surface));
        let open = |h: usize| cut.contains(&(h as u32)) || surface.twin(h).is_some_and(|t| cut.contains(&(t as u32)));
        let disk = surface.disk(&faces, open, &mut crate::surface::FaceLookup::new(&surface)).unwrap();
        assert_eq!((disk.boundary_loops().len(), disk.euler_characteristic()), (1, 1));
        let length: f64 = cut.iter().map(|&h| surface.edge(h as usize).norm()).sum();
        // Once around the tube and once around the hole at its inner side, with the detours of a grid.
        let least = std::f64::consts::TAU * (0.3 + 0.7);
        assert!((0.98 * least..1.5 * least).contains(&length), "{length:.2} m, {least:.2} at least");
    }
}
