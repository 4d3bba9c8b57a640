//! The seams as a graph: arcs between the places where more than two of them meet.

use crate::atlas::charts::Charts;

/// A line of seam edges between the same two charts, without branches.
#[derive(Debug, Clone)]
pub(in crate::atlas) struct Arc {
    /// The half-edges in turn, all in chart `left`.
    pub(in crate::atlas) half_edges: Vec<u32>,
    pub(in crate::atlas) left: u32,
    pub(in crate::atlas) right: u32,
}

impl Arc {
    /// First and last half-edge: what tells it from the others.
    pub(in crate::atlas) fn key(&self) -> (u32, u32) {
        (self.half_edges[0], self.half_edges[self.half_edges.len() - 1])
    }
}

/// All arcs, in the order of their smallest half-edges.
pub(in crate::atlas) fn arcs(charts: &Charts) -> Vec<Arc> {
    let surface = charts.surface;
    let mut degree = vec![0_u8; surface.positions().len()];
    let mut seams = Vec::new();
    for h in 0..3 * surface.faces().len() {
        let open = match surface.twin(h) {
            None => true,
            Some(twin) if h < twin && charts.is_seam(h) => {
                seams.push(h as u32);
                true
            }
            Some(_) => false,
        };
        if open {
            for v in surface.ends(h) {
                degree[v as usize] = degree[v as usize].saturating_add(1);
            }
        }
    }
    // Up to two seam edges at each vertex of degree two.
    let mut at_vertex = vec![[u32::MAX; 2]; surface.positions().len()];
    for &h in &seams {
        for v in surface.ends(h as usize) {
            if degree[v as usize] == 2 {
                let slots = &mut at_vertex[v as usize];
                slots[usize::from(slots[0] != u32::MAX)] = h;
            }
        }
    }
    let mut used = vec![false; 3 * surface.faces().len()];
    let mut found = Vec::new();
    for &start in &seams {
        if used[start as usize] {
            continue;
        }
        used[start as usize] = true;
        let [left, right] = charts.sides(start as usize);
        let mut half_edges = std::collections::VecDeque::from([start]);
        for forward in [true, false] {
            loop {
                let end = if forward { half_edges[half_edges.len() - 1] } else { half_edges[0] } as usize;
                let v = surface.ends(end)[usize::from(forward)];
                let next = at_vertex[v as usize].into_iter().find(|&h| h != u32::MAX && !used[h as usize]);
                let Some(next) = next else { break };
                // The half of the next edge that runs on in the same direction.
                let same = surface.ends(next as usize)[usize::from(!forward)] == v;
                let twin = surface.twin(next as usize).unwrap_or(next as usize);
                let along = if same { next as usize } else { twin };
                if charts.sides(along) != [left, right] {
                    break;
                }
                used[next as usize] = true;
                if forward { half_edges.push_back(along as u32) } else { half_edges.push_front(along as u32) }
            }
        }
        found.push(Arc { half_edges: half_edges.into(), left, right });
    }
    found
}
