//! The graph Laplacian that Tutte's layout and the ARAP energy share.

use std::f64::consts::TAU;

use faer::sparse::linalg::SupernodalThreshold;

use crate::disk::Disk;
use crate::error::Error;
use crate::linear::Spd;
use crate::triangle::Frame;

/// Unknowns from which on the factor is kept in blocks.
const BLOCKS_FROM: usize = 30_000;

/// A graph Laplacian over the vertices of a disk plus one centre per hole. Fixed vertices keep their row as a unit row,
/// so that every system has the same pattern and one symbolic analysis serves all of them.
pub(crate) struct Laplacian {
    spd: Spd,
    vertices: usize,
    size: usize,
    /// Undirected edges (i, j) and where they stand in the matrix.
    edges: Vec<(u32, u32, u32)>,
    /// How many of `edges` belong to the surface; the rest are spokes of hole centres.
    surface_edges: usize,
}

impl Laplacian {
    pub(crate) fn new(disk: &Disk) -> Result<Self, Error> {
        let vertices = disk.positions.len();
        let holes = &disk.loops[1..];
        let size = vertices + holes.len();
        let mut below = Vec::with_capacity(2 * vertices + disk.faces.len());
        for h in 0..disk.twins.len() {
            // Of the two half-edges of an inner edge the smaller one speaks; the border mark is larger than any.
            if (h as u32) < disk.twins[h] {
                let face = disk.faces[h / 3];
                let (a, b) = (face[h % 3], face[(h + 1) % 3]);
                below.push((a.max(b), a.min(b)));
            }
        }
        let surface_edges = below.len();
        for (hole, around) in holes.iter().enumerate() {
            below.extend(around.iter().map(|&v| ((vertices + hole) as u32, v)));
        }
        // Few factorisations and many solves: the plain column factor is read faster than blocks, until making it takes longer than they do.
        let kind = if size > BLOCKS_FROM {
            SupernodalThreshold::FORCE_SUPERNODAL
        } else {
            SupernodalThreshold::FORCE_SIMPLICIAL
        };
        let spd = Spd::new(size, &below, kind)?;
        let edges = below.iter().map(|&(i, j)| (i, j, spd.entry(i, j) as u32)).collect();
        Ok(Self { spd, vertices, size, edges, surface_edges })
    }

    /// Tutte's layout with equal weights: the outer loop on the unit circle in steps that follow its edge lengths, every
    /// other vertex at the mean of its neighbours, holes closed by a centre vertex that is dropped afterwards.
    pub(crate) fn tutte(&mut self, disk: &Disk) -> Result<Vec<[f64; 2]>, Error> {
        let mut fixed = vec![None; self.size];
        for (&v, at) in disk.loops[0].iter().zip(circle(disk)) {
            fixed[v as usize] = Some(at);
        }
        self.spd.values.fill(0.0);
        let mut right = vec![0.0; 2 * self.size];
        for v in 0..self.size {
            if let Some(at) = fixed[v] {
                let diagonal = self.spd.diagonal(v as u32);
                self.spd.values[diagonal] = 1.0;
                right[v] = at[0];
                right[self.size + v] = at[1];
            }
        }
        for &(i, j, entry) in &self.edges {
            if fixed[i as usize].is_none() && fixed[j as usize].is_none() {
                self.spd.values[entry as usize] = -1.0;
            }
            for (from, to) in [(i, j), (j, i)] {
                if fixed[from as usize].is_none() {
                    let diagonal = self.spd.diagonal(from);
                    self.spd.values[diagonal] += 1.0;
                    if let Some(at) = fixed[to as usize] {
                        right[from as usize] += at[0];
                        right[self.size + from as usize] += at[1];
                    }
                }
            }
        }
        self.spd.factorize()?;
        self.spd.solve(&mut right);
        Ok((0..self.vertices).map(|v| [right[v], right[self.size + v]]).collect())
    }

    /// Factorises the cotangent Laplacian `L_ij = sum_t A_t g_i . g_j` with `pinned` held at the origin.
    pub(crate) fn factorize_cotangent(&mut self, disk: &Disk, frames: &[Frame], pinned: u32) -> Result<(), Error> {
        self.spd.values.fill(0.0);
        let mut weight = vec![0.0; self.surface_edges];
        let edge_of = edge_of_half_edge(disk);
        for (f, frame) in frames.iter().enumerate() {
            for k in 0..3 {
                let (g, h) = (frame.g[k], frame.g[(k + 1) % 3]);
                weight[edge_of[3 * f + k] as usize] += frame.area * (g[0] * h[0] + g[1] * h[1]);
            }
        }
        for (&(i, j, entry), weight) in self.edges.iter().zip(weight) {
            if i != pinned && j != pinned {
                self.spd.values[entry as usize] = weight;
            }
            for v in [i, j] {
                let diagonal = self.spd.diagonal(v);
                self.spd.values[diagonal] -= weight;
            }
        }
        // Unit rows, in the scale of the rest, for the pin and for the hole centres that this system does not use.
        for v in std::iter::once(pinned).chain(self.vertices as u32..self.size as u32) {
            let diagonal = self.spd.diagonal(v);
            self.spd.values[diagonal] = 1.0;
        }
        self.spd.factorize()
    }

    /// Length of one right-hand side.
    pub(crate) fn size(&self) -> usize {
        self.size
    }

    pub(crate) fn solve(&mut self, right: &mut [f64]) {
        self.spd.solve(right);
    }
}

/// Index of the undirected edge of each half-edge, in the order in which [`Laplacian::new`] lists them.
fn edge_of_half_edge(disk: &Disk) -> Vec<u32> {
    let mut edge_of = vec![0u32; disk.twins.len()];
    let mut count = 0;
    for h in 0..disk.twins.len() {
        let twin = disk.twins[h];
        if (h as u32) < twin {
            edge_of[h] = count;
            if let Some(slot) = edge_of.get_mut(twin as usize) {
                *slot = count;
            }
            count += 1;
        }
    }
    edge_of
}

/// Places of the outer loop's vertices on the unit circle.
fn circle(disk: &Disk) -> impl Iterator<Item = [f64; 2]> {
    let around = &disk.loops[0];
    let at = |v: u32| nalgebra::Vector3::from(disk.positions[v as usize]);
    let lengths: Vec<f64> =
        around.iter().zip(around.iter().cycle().skip(1)).map(|(&a, &b)| (at(b) - at(a)).norm()).collect();
    let total: f64 = lengths.iter().sum();
    let even = 1.0 / lengths.len() as f64;
    let mut angle = 0.0;
    // A tenth of every step is the same for all: two vertices may be arbitrarily near, their places may not.
    lengths.into_iter().map(move |length| {
        let at = [f64::cos(angle), f64::sin(angle)];
        angle += TAU * (0.9 * length / total + 0.1 * even);
        at
    })
}
