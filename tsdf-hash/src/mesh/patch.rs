//! The piece of surface in the cells of one block.
//!
//! A patch depends on its block and on the first voxels of the seven blocks above it, and on nothing else: when a block
//! changes, eight patches do. Vertices at the upper borders occur in up to four patches, the same in each to the bit,
//! under one name.

use nalgebra::Vector3;

use super::cases::Case;
use super::rows::{Bits, Rows};
use super::weld::EdgeSet;
use crate::block::{Block, SIDE, VOXELS};
use crate::key::Key;

/// Colour of vertices that no colour image has seen.
const UNSEEN: [u8; 3] = [128; 3];
/// Corners of the cells of a block along an axis.
pub(crate) const LATTICE: usize = SIDE + 1;
/// Edges between them, with those that leave the lattice.
const EDGES: usize = 3 * LATTICE * LATTICE * LATTICE;
const NEW: u16 = u16::MAX;

/// Where the surface cuts an edge.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Vertex {
    /// In the world, metres.
    pub(crate) position: [f32; 3],
    /// Sum over the triangles of the patch around it, of twice their areas times their normals.
    pub(crate) normal: [f32; 3],
    pub(crate) colour: [u8; 3],
    /// The axis of the edge; bit 2 is set where its upper end is the free one: the normal of last resort.
    pub(crate) outward: u8,
    /// The block the edge belongs to, that of its lower end: at `+1` along x (bit 0), y (bit 1), z (bit 2).
    pub(crate) step: u8,
    /// Its name in that block.
    pub(crate) edge: u16,
}

/// A patch, and the bits of its block.
#[derive(Default)]
pub(crate) struct Patch {
    pub(crate) bits: Bits,
    pub(crate) vertices: Vec<Vertex>,
    pub(crate) faces: Vec<[u16; 3]>,
    /// Bit `n` is set where a vertex belongs to the block at step `n`.
    pub(crate) steps: u8,
    /// Whether it waits to be made again.
    pub(crate) dirty: bool,
}

/// Working memory for making patches.
pub(crate) struct Bench {
    /// Vertex on an edge of the lattice.
    vertex: Vec<u16>,
    cells: Vec<(u16, u8)>,
}

impl Bench {
    pub(crate) fn new() -> Self {
        Self { vertex: vec![NEW; EDGES], cells: Vec::new() }
    }

    /// Finds the cells that the surface crosses and returns the blocks that their corners lie in, bit `n` for step `n`.
    pub(crate) fn find(&mut self, bits: &[Option<Bits>; 8]) -> u8 {
        self.cells.clear();
        let mut blocks = 0;
        Rows::with_border(bits).crossed(|cell, case| {
            self.cells.push(((cell[0] + LATTICE * (cell[1] + LATTICE * cell[2])) as u16, case));
            // The steps that this cell takes beyond the block, in any combination.
            blocks |= [0b1, 0b11, 0b101, 0b1111, 0b1_0001, 0b11_0011, 0b101_0101, 0xff]
                [(0..3).fold(0, |steps, k| steps | usize::from(cell[k] + 1 == SIDE) << k)];
        });
        blocks
    }

    /// Makes the patch of the cells that were found.
    pub(crate) fn make(
        &mut self,
        patch: &mut Patch,
        key: Key,
        blocks: &[Option<&Block>; 8],
        cases: &[Case],
        voxel_size: f64,
    ) {
        patch.clear();
        let lattice = Lattice { corner: key.block().map(|c| f64::from(c) * SIDE as f64), blocks, voxel_size };
        for &(cell, case) in &self.cells {
            let case = &cases[usize::from(case)];
            let mut corners = [0; 12];
            for (corner, &edge) in corners.iter_mut().zip(&case.edges) {
                let edge = 3 * usize::from(cell) + usize::from(edge);
                if self.vertex[edge] == NEW {
                    self.vertex[edge] = patch.vertices.len() as u16;
                    let vertex = lattice.vertex(edge);
                    patch.steps |= 1 << vertex.step;
                    patch.vertices.push(vertex);
                }
                *corner = self.vertex[edge];
            }
            patch.faces.extend(case.triangles.iter().map(|triangle| triangle.map(|k| corners[usize::from(k)])));
        }
        for &(cell, case) in &self.cells {
            for &edge in &cases[usize::from(case)].edges {
                self.vertex[3 * usize::from(cell) + usize::from(edge)] = NEW;
            }
        }
        patch.add_normals();
    }
}

impl Patch {
    pub(crate) fn clear(&mut self) {
        self.vertices.clear();
        self.faces.clear();
        self.steps = 0;
    }

    fn add_normals(&mut self) {
        for face in &self.faces {
            let [a, b, c] = face.map(|k| Vector3::from(self.vertices[usize::from(k)].position));
            let normal = (b - a).cross(&(c - a));
            for &k in face {
                let sum = &mut self.vertices[usize::from(k)].normal;
                *sum = [0, 1, 2].map(|k| sum[k] + normal[k]);
            }
        }
    }
}

/// The voxels of a block and the first ones of those above it.
struct Lattice<'a> {
    /// The first voxel of the block.
    corner: [f64; 3],
    blocks: &'a [Option<&'a Block>; 8],
    voxel_size: f64,
}

impl<'a> Lattice<'a> {
    fn vertex(&self, edge: usize) -> Vertex {
        let (point, axis) = (edge / 3, edge % 3);
        let at = [point % LATTICE, point / LATTICE % LATTICE, point / (LATTICE * LATTICE)];
        let mut beyond = at;
        beyond[axis] += 1;
        let (step, voxel) = place(at);
        let (other_step, other) = place(beyond);
        let ends = [(self.blocks[step], voxel), (self.blocks[other_step], other)];
        let [a, b] = ends.map(|(block, voxel)| block.and_then(|block| block.mean(voxel)).unwrap_or(0.0));
        let t = a / (a - b);
        let position = [0, 1, 2].map(|k| {
            let along = if k == axis { f64::from(t) } else { 0.0 };
            ((self.corner[k] + at[k] as f64 + 0.5 + along) * self.voxel_size) as f32
        });
        Vertex {
            position,
            normal: [0.0; 3],
            colour: blend(ends, t),
            outward: axis as u8 | u8::from(a < b) << 2,
            step: step as u8,
            edge: EdgeSet::edge(voxel, axis) as u16,
        }
    }
}

/// The block of a point of the lattice, and the voxel there.
fn place(at: [usize; 3]) -> (usize, usize) {
    let step = at[0] / SIDE | at[1] / SIDE << 1 | at[2] / SIDE << 2;
    (step, (at[0] % SIDE + SIDE * (at[1] % SIDE + SIDE * (at[2] % SIDE))) % VOXELS)
}

fn blend(ends: [(Option<&Block>, usize); 2], t: f32) -> [u8; 3] {
    match ends.map(|(block, voxel)| block.and_then(|block| block.mean_colour(voxel))) {
        [Some(a), Some(b)] => [0, 1, 2].map(|k| (a[k] + t * (b[k] - a[k])).round() as u8),
        [Some(one), None] | [None, Some(one)] => one.map(|c| c.round() as u8),
        [None, None] => UNSEEN,
    }
}
