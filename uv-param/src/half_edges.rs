//! Half-edges: who shares an edge with whom.

/// Marks a half-edge without a face on its other side.
pub(crate) const BORDER: u32 = u32::MAX;

/// Undirected edges of a triangle list with the half-edges along each, in a fixed order.
pub(crate) struct EdgeTable {
    /// Half-edges, grouped by undirected edge.
    half_edges: Vec<u32>,
    /// Start of each group; one more than there are edges.
    starts: Vec<u32>,
}

impl EdgeTable {
    pub(crate) fn new(vertices: usize, faces: &[[u32; 3]]) -> Self {
        // Counting sort by the smaller end, then a tiny sort inside each bucket: linear for meshes.
        let mut bucket = vec![0u32; vertices + 1];
        let ends = |h: usize| {
            let (a, b) = half_edge(faces, h);
            (a.min(b), a.max(b))
        };
        for h in 0..3 * faces.len() {
            bucket[ends(h).0 as usize + 1] += 1;
        }
        for v in 0..vertices {
            bucket[v + 1] += bucket[v];
        }
        let mut cursor = bucket.clone();
        let mut half_edges = vec![0u32; 3 * faces.len()];
        for h in 0..3 * faces.len() {
            let slot = &mut cursor[ends(h).0 as usize];
            half_edges[*slot as usize] = h as u32;
            *slot += 1;
        }
        let mut starts = Vec::with_capacity(2 * faces.len());
        for v in 0..vertices {
            let (from, to) = (bucket[v] as usize, bucket[v + 1] as usize);
            half_edges[from..to].sort_unstable_by_key(|&h| (ends(h as usize).1, h));
            for i in from..to {
                if i == from || ends(half_edges[i] as usize).1 != ends(half_edges[i - 1] as usize).1 {
                    starts.push(i as u32);
                }
            }
        }
        starts.push(half_edges.len() as u32);
        Self { half_edges, starts }
    }

    /// The half-edges along each undirected edge.
    pub(crate) fn groups(&self) -> impl Iterator<Item = &[u32]> {
        self.starts.windows(2).map(|w| &self.half_edges[w[0] as usize..w[1] as usize])
    }
}

/// Start and end vertex of half-edge `h`.
pub(crate) fn half_edge(faces: &[[u32; 3]], h: usize) -> (u32, u32) {
    let face = faces[h / 3];
    (face[h % 3], face[(h + 1) % 3])
}

/// Boundary loops of a vertex-manifold, oriented mesh, in the direction of the faces, each from its smallest vertex.
pub(crate) fn boundary_loops(vertices: usize, faces: &[[u32; 3]], twins: &[u32]) -> Vec<Vec<u32>> {
    let mut next = vec![BORDER; vertices];
    for (h, &twin) in twins.iter().enumerate() {
        if twin == BORDER {
            let (a, b) = half_edge(faces, h);
            next[a as usize] = b;
        }
    }
    let mut loops = Vec::new();
    for start in 0..vertices {
        if next[start] == BORDER {
            continue;
        }
        let mut around = Vec::new();
        let mut v = start;
        while next[v] != BORDER {
            around.push(v as u32);
            v = std::mem::replace(&mut next[v], BORDER) as usize;
        }
        loops.push(around);
    }
    loops
}

/// The fans of faces around the vertices: the fan of every corner, and the vertex of every fan, fans in the order of their
/// first corners. A vertex of a manifold has one fan.
pub(crate) fn fans(faces: &[[u32; 3]], twins: &[u32]) -> (Vec<u32>, Vec<u32>) {
    let next = |h: usize| h / 3 * 3 + (h + 1) % 3;
    let previous = |h: usize| h / 3 * 3 + (h + 2) % 3;
    let corners = 3 * faces.len();
    let mut fan_of_corner = vec![BORDER; corners];
    let mut vertex_of_fan = Vec::new();
    for start in 0..corners {
        if fan_of_corner[start] != BORDER {
            continue;
        }
        let fan = vertex_of_fan.len() as u32;
        vertex_of_fan.push(faces[start / 3][start % 3]);
        // One way around until the boundary or the start, then the other way.
        let mut corner = start;
        loop {
            fan_of_corner[corner] = fan;
            let twin = twins[previous(corner)];
            if twin == BORDER || twin as usize == start {
                break;
            }
            corner = twin as usize;
        }
        let mut corner = start;
        while twins[corner] != BORDER && fan_of_corner[next(twins[corner] as usize)] == BORDER {
            corner = next(twins[corner] as usize);
            fan_of_corner[corner] = fan;
        }
    }
    (fan_of_corner, vertex_of_fan)
}
