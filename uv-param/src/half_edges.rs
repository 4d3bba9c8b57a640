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
        // Buckets by the smaller end, then a tiny sort by the larger one inside each: linear for meshes.
        let along = |h: usize| {
            let (a, b) = half_edge(faces, h);
            (a.min(b), u64::from(a.max(b)) << 32 | h as u64)
        };
        let (buckets, mut keys) = grouped(vertices, (0..3 * faces.len()).map(along));
        let mut starts = Vec::with_capacity(2 * faces.len());
        for bucket in buckets.windows(2) {
            let (from, to) = (bucket[0] as usize, bucket[1] as usize);
            keys[from..to].sort_unstable();
            starts.extend((from..to).filter(|&i| i == from || keys[i] >> 32 != keys[i - 1] >> 32).map(|i| i as u32));
        }
        starts.push(keys.len() as u32);
        Self { half_edges: keys.into_iter().map(|key| key as u32).collect(), starts }
    }

    /// The half-edges along each undirected edge.
    pub(crate) fn groups(&self) -> impl Iterator<Item = &[u32]> {
        self.starts.windows(2).map(|w| &self.half_edges[w[0] as usize..w[1] as usize])
    }
}

/// Items in buckets by a number below `buckets`, in their order within each (counting sort): where each bucket starts, one
/// more than there are, and the items.
pub(crate) fn grouped<T: Copy + Default>(
    buckets: usize,
    items: impl ExactSizeIterator<Item = (u32, T)> + Clone,
) -> (Vec<u32>, Vec<T>) {
    let mut starts = vec![0u32; buckets + 1];
    for (bucket, _) in items.clone() {
        starts[bucket as usize + 1] += 1;
    }
    for bucket in 0..buckets {
        starts[bucket + 1] += starts[bucket];
    }
    let mut cursor = starts.clone();
    let mut sorted = vec![T::default(); items.len()];
    for (bucket, item) in items {
        let slot = &mut cursor[bucket as usize];
        sorted[*slot as usize] = item;
        *slot += 1;
    }
    (starts, sorted)
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
