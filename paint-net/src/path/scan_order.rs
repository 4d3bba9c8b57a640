//! The order in which the cells of a grid are visited.

/// How the path over all cells runs. Either way each step goes to one of the four neighbours: both paths have one length.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum ScanOrder {
    /// Row by row, every other row backwards.
    #[default]
    Boustrophedon,
    /// Along cells of like volume, as far as one path over all cells can (context-based space filling curve; Dafner, Cohen-Or
    /// and Matias 2000).
    ContextBased,
}

impl ScanOrder {
    /// All cells in flying order. `volumes`: what the cells are wanted to get, row by row.
    pub(crate) fn path(self, columns: usize, rows: usize, volumes: &[f64]) -> Vec<usize> {
        match self {
            Self::ContextBased if columns > 1 && rows > 1 => context_based(columns, rows, volumes),
            Self::Boustrophedon | Self::ContextBased => boustrophedon(columns, rows),
        }
    }
}

fn boustrophedon(columns: usize, rows: usize) -> Vec<usize> {
    (0..rows)
        .flat_map(|j| (0..columns).map(move |i| j * columns + if j % 2 == 0 { i } else { columns - 1 - i }))
        .collect()
}

/// Every block of 2 x 2 cells is a round trip. Two neighbouring round trips become one where two edges that face each other
/// are exchanged for the two that join them; a spanning tree of such exchanges leaves one round trip over all cells. The tree
/// is the one with the least sum of differences (Kruskal 1956). A last odd column and row are flown at the end.
fn context_based(columns: usize, rows: usize, volumes: &[f64]) -> Vec<usize> {
    let (across, down) = (columns / 2, rows / 2);
    let cell = |i: usize, j: usize| j * columns + i;
    let difference = |a: usize, b: usize| (volumes[a] - volumes[b]).abs();
    // Exchanges: the two blocks, and the four cells: p-q and r-s are flown now, p-r and q-s would be.
    let mut exchanges = Vec::with_capacity(2 * across * down);
    for j in 0..down {
        for i in 0..across {
            let (x, y, block) = (2 * i, 2 * j, j * across + i);
            if i + 1 < across {
                let cells = [cell(x + 1, y), cell(x + 1, y + 1), cell(x + 2, y), cell(x + 2, y + 1)];
                exchanges.push((block, block + 1, cells));
            }
            if j + 1 < down {
                let cells = [cell(x, y + 1), cell(x + 1, y + 1), cell(x, y + 2), cell(x + 1, y + 2)];
                exchanges.push((block, block + across, cells));
            }
        }
    }
    let cost = |&(_, _, [p, q, r, s]): &(usize, usize, [usize; 4])| {
        difference(p, r) + difference(q, s) - difference(p, q) - difference(r, s)
    };
    exchanges.sort_by(|a, b| cost(a).total_cmp(&cost(b)));

    let mut neighbours = vec![[usize::MAX; 2]; columns * rows];
    for j in 0..down {
        for i in 0..across {
            let ring = [cell(2 * i, 2 * j), cell(2 * i + 1, 2 * j), cell(2 * i + 1, 2 * j + 1), cell(2 * i, 2 * j + 1)];
            for k in 0..4 {
                neighbours[ring[k]] = [ring[(k + 3) % 4], ring[(k + 1) % 4]];
            }
        }
    }
    let mut sets = DisjointSets::new(across * down);
    for (a, b, [p, q, r, s]) in exchanges {
        if sets.join(a, b) {
            for (from, old, new) in [(p, q, r), (r, s, p), (q, p, s), (s, r, q)] {
                neighbours[from].iter_mut().filter(|l| **l == old).for_each(|l| *l = new);
            }
        }
    }
    // The round trip is cut so that it ends in the corner from which what is odd can be flown.
    let corner = if columns % 2 == 1 { cell(2 * across - 1, 0) } else { cell(2 * across - 1, 2 * down - 1) };
    let mut path = Vec::with_capacity(columns * rows);
    let (mut before, mut now) = (corner, neighbours[corner][0]);
    while now != corner {
        path.push(now);
        let next = neighbours[now][usize::from(neighbours[now][0] == before)];
        (before, now) = (now, next);
    }
    path.push(corner);
    if columns % 2 == 1 {
        path.extend((0..rows).map(|j| cell(columns - 1, j)));
    }
    if rows % 2 == 1 {
        path.extend((0..2 * across).rev().map(|i| cell(i, rows - 1)));
    }
    path
}

/// Sets that are joined (union-find with path halving).
struct DisjointSets {
    parent: Vec<usize>,
}

impl DisjointSets {
    fn new(count: usize) -> Self {
        Self { parent: (0..count).collect() }
    }

    fn root(&mut self, mut k: usize) -> usize {
        while self.parent[k] != k {
            self.parent[k] = self.parent[self.parent[k]];
            k = self.parent[k];
        }
        k
    }

    /// Whether the two were apart until now.
    fn join(&mut self, a: usize, b: usize) -> bool {
        let (a, b) = (self.root(a), self.root(b));
        self.parent[a.max(b)] = a.min(b);
        a != b
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::procedural::lattice;

    #[test]
    fn every_cell_is_flown_over_once_by_steps_to_neighbours() {
        for (columns, rows) in
            [(1, 1), (1, 7), (6, 1), (2, 2), (3, 2), (2, 3), (3, 3), (8, 6), (9, 6), (8, 7), (13, 11)]
        {
            let volumes: Vec<f64> = (0..columns * rows).map(|k| lattice(3, k as i64, 1)).collect();
            for order in [ScanOrder::Boustrophedon, ScanOrder::ContextBased] {
                let path = order.path(columns, rows, &volumes);
                let mut sorted = path.clone();
                sorted.sort_unstable();
                assert!(sorted.into_iter().eq(0..columns * rows), "{order:?} over {columns} x {rows}");
                for p in path.windows(2) {
                    let (dx, dy) =
                        ((p[0] % columns).abs_diff(p[1] % columns), (p[0] / columns).abs_diff(p[1] / columns));
                    assert_eq!(dx + dy, 1, "{order:?} over {columns} x {rows}: {} to {}", p[0], p[1]);
                }
            }
        }
    }

    #[test]
    fn the_context_based_path_follows_like_volumes() {
        // Vertical stripes two cells wide: rows change at every stripe, the other path only where it must.
        let volumes: Vec<f64> = (0..20 * 20).map(|k| f64::from(k % 20 / 2 % 2)).collect();
        let changes = |order: ScanOrder| {
            let path = order.path(20, 20, &volumes);
            path.windows(2).filter(|p| volumes[p[0]] != volumes[p[1]]).count()
        };
        assert_eq!(changes(ScanOrder::Boustrophedon), 20 * 9);
        // Ten stripes are joined by nine bridges, each there and back but for the one where the round trip is cut.
        assert!(changes(ScanOrder::ContextBased) <= 18, "{}", changes(ScanOrder::ContextBased));
    }
}
