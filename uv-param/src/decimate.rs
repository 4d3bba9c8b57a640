//! A coarser surface for decisions that need no detail: edges collapse onto one of their ends (Garland and Heckbert 1997, quadric error),
//! so that the vertices that are left, and the topology, are those of the input.

use nalgebra::Vector3;

use crate::half_edges::BORDER;

/// Share of the vertices that may go in one round: the cheapest.
const SHARE: f64 = 0.65;
/// A round that removes less than this share of the faces is the last.
const LEAST_GAIN: f64 = 0.01;
/// Weight of the length of an edge against the distance from the old planes: vertices stay evenly spread.
const SPREAD: f64 = 0.01;
/// Cosine of the largest turn of a face in one collapse.
const MAX_TURN: f64 = 0.3;
/// Least double area of a new face over its squared longest edge.
const LEAST_SHAPE: f64 = 0.1;

/// What is left of a surface.
pub(crate) struct Decimated {
    /// Corners as before.
    pub(crate) faces: Vec<[u32; 3]>,
    /// Half-edges on the other sides.
    pub(crate) twins: Vec<u32>,
    /// For every half-edge one of the input that had the same flags.
    pub(crate) half_edge_source: Vec<u32>,
    /// For every vertex that one, still in use, onto which it went.
    pub(crate) root: Vec<u32>,
}

/// At most about `target` faces, if the topology allows. Vertices for which `pinned` holds stay.
pub(crate) fn decimate(
    positions: &[[f64; 3]],
    faces: &[[u32; 3]],
    twins: &[u32],
    pinned: Vec<bool>,
    target: usize,
) -> Decimated {
    let mut mesh = Mesh::new(positions, faces, twins, pinned);
    let mut alive = faces.len();
    let mut touched = vec![0_u32; positions.len()];
    let mut left: Vec<u32> = (0..positions.len() as u32).collect();
    for round in 1.. {
        if alive <= target {
            break;
        }
        left.retain(|&v| mesh.root[v as usize] == v);
        // Whether the topology allows a collapse is asked of those that are taken: of few, and it takes as long as all the rest.
        let found: Vec<Option<(f64, u32)>> = left.iter().map(|&v| mesh.best(v, false)).collect();
        let mut sorted: Vec<f64> = found.iter().flatten().map(|(cost, _)| *cost).collect();
        if sorted.is_empty() {
            break;
        }
        let place = ((SHARE * sorted.len() as f64) as usize).min(sorted.len() - 1);
        let limit = *sorted.select_nth_unstable_by(place, f64::total_cmp).1;
        let before = alive;
        for (&v, found) in left.iter().zip(found) {
            if alive <= target {
                break;
            }
            let Some((cost, onto)) = found else { continue };
            if cost > limit || touched[v as usize] == round {
                continue;
            }
            // Nothing around it has changed since; where the first choice is barred, the next ones are asked.
            let onto = if mesh.is_sound(v, onto) { Some(onto) } else { mesh.best(v, true).map(|(_, onto)| onto) };
            let Some(onto) = onto else { continue };
            for &h in &mesh.ring {
                for corner in mesh.faces[h as usize / 3] {
                    touched[corner as usize] = round;
                }
            }
            alive -= mesh.collapse(v, onto);
        }
        if ((before - alive) as f64) < LEAST_GAIN * before as f64 {
            break;
        }
    }
    mesh.finish()
}

fn next(h: u32) -> u32 {
    h / 3 * 3 + (h + 1) % 3
}

fn previous(h: u32) -> u32 {
    h / 3 * 3 + (h + 2) % 3
}

/// The upper triangle of a symmetric 4 x 4 matrix: squared distance from planes, weighted by area.
type Quadric = [f64; 10];

struct Mesh<'a> {
    positions: &'a [[f64; 3]],
    faces: Vec<[u32; 3]>,
    twins: Vec<u32>,
    half_edge_source: Vec<u32>,
    dead: Vec<bool>,
    /// A half-edge that leaves each vertex.
    out: Vec<u32>,
    /// Faces around each vertex, and whether it lies on the border.
    count: Vec<u32>,
    on_border: Vec<bool>,
    pinned: Vec<bool>,
    quadrics: Vec<Quadric>,
    root: Vec<u32>,
    /// The half-edges that leave the vertex that was looked at last.
    ring: Vec<u32>,
    other_ring: Vec<u32>,
    /// Collapses of that vertex and what they cost.
    candidates: Vec<(f64, u32)>,
    marks: Vec<u32>,
    mark: u32,
}

impl<'a> Mesh<'a> {
    fn new(positions: &'a [[f64; 3]], faces: &[[u32; 3]], twins: &[u32], mut pinned: Vec<bool>) -> Self {
        let mut out = vec![BORDER; positions.len()];
        let mut count = vec![0_u32; positions.len()];
        let mut quadrics = vec![[0.0; 10]; positions.len()];
        for (f, face) in faces.iter().enumerate() {
            let corners = face.map(|v| Vector3::from(positions[v as usize]));
            let cross = (corners[1] - corners[0]).cross(&(corners[2] - corners[0]));
            let doubled = cross.norm();
            let plane = quadric(cross / doubled.max(f64::MIN_POSITIVE), corners[0], doubled);
            for (k, &v) in face.iter().enumerate() {
                out[v as usize] = (3 * f + k) as u32;
                count[v as usize] += 1;
                add(&mut quadrics[v as usize], &plane);
                // The border stays in place: a plane through it, upright on the face.
                if twins[3 * f + k] == BORDER {
                    let w = face[(k + 1) % 3];
                    let edge = corners[(k + 1) % 3] - corners[k];
                    let upright = edge.cross(&cross).try_normalize(0.0).unwrap_or_else(Vector3::zeros);
                    let upright = quadric(upright, corners[k], edge.norm_squared());
                    add(&mut quadrics[v as usize], &upright);
                    add(&mut quadrics[w as usize], &upright);
                }
            }
        }
        let root = (0..positions.len() as u32).collect();
        let half_edge_source = (0..twins.len() as u32).collect();
        let mut mesh = Self {
            positions,
            faces: faces.to_vec(),
            twins: twins.to_vec(),
            half_edge_source,
            dead: vec![false; faces.len()],
            out,
            count,
            on_border: vec![false; positions.len()],
            pinned: Vec::new(),
            quadrics,
            root,
            ring: Vec::new(),
            other_ring: Vec::new(),
            candidates: Vec::new(),
            marks: vec![0; positions.len()],
            mark: 0,
        };
        // Where several fans of faces meet in a vertex nothing moves.
        for (v, pinned) in pinned.iter_mut().enumerate() {
            if mesh.count[v] == 0 {
                *pinned = true;
                continue;
            }
            let mut ring = std::mem::take(&mut mesh.ring);
            mesh.on_border[v] = mesh.fan(v as u32, &mut ring);
            *pinned |= ring.len() as u32 != mesh.count[v];
            mesh.ring = ring;
        }
        mesh.pinned = pinned;
        mesh
    }

    fn position(&self, v: u32) -> Vector3<f64> {
        Vector3::from(self.positions[v as usize])
    }

    fn start(&self, h: u32) -> u32 {
        self.faces[h as usize / 3][h as usize % 3]
    }

    fn twin(&self, h: u32) -> Option<u32> {
        Some(self.twins[h as usize]).filter(|&twin| twin != BORDER)
    }

    /// The half-edges that leave a vertex; whether it lies on the border.
    fn fan(&self, v: u32, ring: &mut Vec<u32>) -> bool {
        ring.clear();
        let first = self.out[v as usize];
        let mut h = first;
        loop {
            ring.push(h);
            match self.twin(previous(h)) {
                None => break,
                Some(twin) if twin == first => return false,
                Some(twin) => h = twin,
            }
        }
        h = first;
        while let Some(twin) = self.twin(h) {
            h = next(twin);
            ring.push(h);
        }
        true
    }

    /// The cheapest collapse of a vertex that turns no face over, and, if `sound`, changes no topology: its cost, and the half-edge along
    /// which it goes, from either end. The ring is that of the vertex afterwards.
    fn best(&mut self, v: u32, sound: bool) -> Option<(f64, u32)> {
        if self.pinned[v as usize] || self.root[v as usize] != v {
            return None;
        }
        let mut ring = std::mem::take(&mut self.ring);
        let mut candidates = std::mem::take(&mut self.candidates);
        candidates.clear();
        let border = self.fan(v, &mut ring);
        let here = self.position(v);
        let area: f64 = ring.iter().map(|&h| self.doubled_area(h / 3)).sum();
        let mut offer = |h: u32, w: u32| {
            let there = self.position(w);
            let error = distance(&self.quadrics[v as usize], there) + distance(&self.quadrics[w as usize], there);
            candidates.push((error + SPREAD * area * (there - here).norm_squared(), h));
        };
        for &h in &ring {
            if !border || self.twins[h as usize] == BORDER {
                offer(h, self.start(next(h)));
            }
            if border && self.twins[previous(h) as usize] == BORDER {
                offer(previous(h), self.start(previous(h)));
            }
        }
        let mut found = None;
        while found.is_none() && !candidates.is_empty() {
            let order = |a: &(f64, u32), b: &(f64, u32)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
            let least = (1..candidates.len())
                .fold(0, |least, i| if order(&candidates[i], &candidates[least]).is_lt() { i } else { least });
            let candidate = candidates.swap_remove(least);
            let allowed = self.keeps_shapes(v, candidate.1, &ring)
                && (!sound || self.keeps_topology(v, candidate.1, &ring, border));
            found = allowed.then_some(candidate);
        }
        (self.ring, self.candidates) = (ring, candidates);
        found
    }

    /// Whether a collapse changes no topology. The ring is that of the vertex afterwards.
    fn is_sound(&mut self, v: u32, onto: u32) -> bool {
        let mut ring = std::mem::take(&mut self.ring);
        let border = self.fan(v, &mut ring);
        let sound = self.keeps_topology(v, onto, &ring, border);
        self.ring = ring;
        sound
    }

    fn doubled_area(&self, face: u32) -> f64 {
        let [a, b, c] = self.faces[face as usize].map(|v| self.position(v));
        (b - a).cross(&(c - a)).norm()
    }

    /// The end of a half-edge that is not `v`.
    fn end(&self, h: u32, v: u32) -> u32 {
        if self.start(h) == v { self.start(next(h)) } else { self.start(h) }
    }

    /// The faces that go with a half-edge.
    fn gone(&self, onto: u32) -> [Option<u32>; 2] {
        [Some(onto / 3), self.twin(onto).map(|twin| twin / 3)]
    }

    fn keeps_topology(&mut self, v: u32, onto: u32, ring: &[u32], border: bool) -> bool {
        let w = self.end(onto, v);
        if self.pinned[w as usize] && self.out[w as usize] == BORDER {
            return false;
        }
        let gone = self.gone(onto);
        if border && ring.len() < 2 {
            return false;
        }
        // The two ends have no other neighbour in common than the corners that face the edge, and these keep enough faces.
        self.mark += 1;
        for &h in ring {
            for corner in self.faces[h as usize / 3] {
                self.marks[corner as usize] = self.mark;
            }
        }
        let mut other = std::mem::take(&mut self.other_ring);
        self.fan(w, &mut other);
        let mut common = 0;
        self.mark += 1;
        for &h in &other {
            for corner in self.faces[h as usize / 3] {
                let mark = &mut self.marks[corner as usize];
                if *mark + 1 == self.mark {
                    common += 1;
                    *mark = self.mark;
                }
            }
        }
        // The ends themselves are among them.
        let faces = gone.iter().flatten().count();
        let mut sound = common == faces + 2;
        for h in [Some(onto), self.twin(onto)].into_iter().flatten() {
            let apex = self.start(previous(h)) as usize;
            sound &= self.count[apex] > if self.on_border[apex] { 1 } else { 3 };
        }
        self.other_ring = other;
        sound
    }

    fn keeps_shapes(&self, v: u32, onto: u32, ring: &[u32]) -> bool {
        let gone = self.gone(onto);
        let (here, there) = (self.position(v), self.position(self.end(onto, v)));
        ring.iter().filter(|&&h| !gone.contains(&Some(h / 3))).all(|&h| {
            let [a, b] = [self.start(next(h)), self.start(previous(h))].map(|v| self.position(v));
            let old = (a - here).cross(&(b - here));
            let new = (a - there).cross(&(b - there));
            let longest = (a - there).norm_squared().max((b - there).norm_squared()).max((b - a).norm_squared());
            new.norm() > LEAST_SHAPE * longest && new.dot(&old) > MAX_TURN * new.norm() * old.norm()
        })
    }

    /// Takes a vertex, whose ring is at hand, along a half-edge; returns the number of faces that go.
    fn collapse(&mut self, v: u32, onto: u32) -> usize {
        let w = self.end(onto, v);
        let ring = std::mem::take(&mut self.ring);
        let mut gone = 0;
        for h in [Some(onto), self.twin(onto)].into_iter().flatten() {
            let face = h / 3;
            self.dead[face as usize] = true;
            gone += 1;
            let sides = [next(h), previous(h)];
            let twins = sides.map(|side| self.twin(side));
            let apex = self.start(previous(h));
            self.count[apex as usize] -= 1;
            for k in 0..2 {
                if let Some(twin) = twins[k] {
                    self.twins[twin as usize] = twins[1 - k].unwrap_or(BORDER);
                    // The side that does not touch the vertex that goes tells what the edge is.
                    let stays = usize::from(self.start(sides[0]) == v || self.start(next(sides[0])) == v);
                    if k != stays {
                        self.half_edge_source[twin as usize] = self.half_edge_source[sides[stays] as usize];
                    }
                }
            }
            // Half-edges that leave the three corners afterwards: the first side runs to the apex, the second from it.
            if let Some(twin) = twins[0] {
                (self.out[apex as usize], self.out[w as usize]) = (twin, next(twin));
            }
            if let Some(twin) = twins[1] {
                (self.out[apex as usize], self.out[w as usize]) = (next(twin), twin);
            }
        }
        for &h in ring.iter().filter(|h| !self.dead[**h as usize / 3]) {
            self.faces[h as usize / 3][h as usize % 3] = w;
            self.out[w as usize] = h;
        }
        // The faces that go had been around both.
        self.count[w as usize] += ring.len() as u32;
        self.count[w as usize] -= 2 * gone as u32;
        let quadric = self.quadrics[v as usize];
        add(&mut self.quadrics[w as usize], &quadric);
        self.root[v as usize] = w;
        self.ring = ring;
        gone
    }

    fn finish(mut self) -> Decimated {
        for v in 0..self.root.len() {
            let mut root = self.root[v];
            while self.root[root as usize] != root {
                root = self.root[root as usize];
            }
            self.root[v] = root;
        }
        let mut number = vec![BORDER; self.faces.len()];
        let kept: Vec<u32> = (0..self.faces.len() as u32).filter(|&f| !self.dead[f as usize]).collect();
        for (new, &f) in kept.iter().enumerate() {
            number[f as usize] = new as u32;
        }
        let half_edges = || kept.iter().flat_map(|&f| 3 * f..3 * f + 3);
        let twin = |h: u32| self.twin(h).map_or(BORDER, |twin| 3 * number[twin as usize / 3] + twin % 3);
        Decimated {
            faces: kept.iter().map(|&f| self.faces[f as usize]).collect(),
            twins: half_edges().map(twin).collect(),
            half_edge_source: half_edges().map(|h| self.half_edge_source[h as usize]).collect(),
            root: self.root,
        }
    }
}

/// The squared distance from a plane through `at`, times a weight.
fn quadric(normal: Vector3<f64>, at: Vector3<f64>, weight: f64) -> Quadric {
    let n = [normal.x, normal.y, normal.z, -normal.dot(&at)];
    let mut entries = [0.0; 10];
    let pairs = (0..4).flat_map(|i| (i..4).map(move |j| (i, j)));
    for (entry, (i, j)) in entries.iter_mut().zip(pairs) {
        *entry = weight * n[i] * n[j];
    }
    entries
}

fn add(to: &mut Quadric, other: &Quadric) {
    to.iter_mut().zip(other).for_each(|(a, b)| *a += b);
}

fn distance(q: &Quadric, p: Vector3<f64>) -> f64 {
    let rows = [
        q[0] * p.x + 2.0 * (q[1] * p.y + q[2] * p.z + q[3]),
        q[4] * p.y + 2.0 * (q[5] * p.z + q[6]),
        q[7] * p.z + 2.0 * q[8],
    ];
    (rows[0] * p.x + rows[1] * p.y + rows[2] * p.z + q[9]).max(0.0)
}
