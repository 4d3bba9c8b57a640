//! The piece of surface in the cells of one block.
//!
//! A patch depends on its block and on the first voxels of the seven blocks above it, and on nothing else: when a block
//! changes, eight patches do. Vertices at the upper borders occur in up to four patches, the same in each to the bit,
//! under one name.

use nalgebra::Vector3;

use super::cases::Case;
use super::rows::{Bits, Rows};
use super::weld::EdgeSet;
use crate::Settings;
use crate::block::{Block, ONE, SIDE, VOXELS};
use crate::key::Key;

/// Colour of vertices that no colour image has seen.
const UNSEEN: [u8; 3] = [128; 3];
/// Corners of the cells of a block along an axis.
pub(crate) const LATTICE: usize = SIDE + 1;
/// Edges between them, with those that leave the lattice.
const EDGES: usize = 3 * LATTICE * LATTICE * LATTICE;
const NEW: u16 = u16::MAX;
/// No distance changes by more than a voxel from one voxel to the next. Where its mean changes by more than this many
/// (ours), no surface lies between the two: they were seen from two sides, and one of them through something.
const MOST_RISE: f64 = 1.75;

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
    /// The distance jumps here: see [`MOST_RISE`].
    torn: bool,
}

/// A patch, and the bits of its block.
#[derive(Default)]
pub(crate) struct Patch {
    pub(crate) bits: Bits,
    pub(crate) vertices: Vec<Vertex>,
    pub(crate) faces: Vec<[u16; 3]>,
    /// Bit `n` is set where a vertex belongs to the block at step `n`.
    pub(crate) steps: u8,
    /// Whether its block has changed since the bits were read.
    pub(crate) unread: bool,
    /// Whether it waits to be made again.
    pub(crate) dirty: bool,
}

/// Working memory for making patches.
pub(crate) struct Bench {
    /// Vertex on an edge of the lattice.
    vertex: Vec<u16>,
    /// Crossed cells, and the edges that are cut.
    cells: Vec<(u16, u8)>,
    edges: Vec<u16>,
}

impl Bench {
    pub(crate) fn new() -> Self {
        Self { vertex: vec![NEW; EDGES], cells: Vec::new(), edges: Vec::new() }
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

    /// Makes the patch of the cells that were found; `blocks` are those that their corners lie in.
    pub(crate) fn make(&mut self, patch: &mut Patch, key: Key, blocks: &[&Block; 8], cases: &[Case], scale: &Scale) {
        patch.clear();
        self.edges.clear();
        patch.faces.reserve(2 * self.cells.len());
        for &(cell, case) in &self.cells {
            let case = &cases[usize::from(case)];
            let mut corners = [0; 12];
            for (corner, &edge) in corners.iter_mut().zip(&case.edges) {
                let edge = 3 * cell + edge;
                let vertex = &mut self.vertex[usize::from(edge)];
                if *vertex == NEW {
                    *vertex = self.edges.len() as u16;
                    self.edges.push(edge);
                }
                *corner = *vertex;
            }
            patch.faces.extend(case.triangles.iter().map(|triangle| triangle.map(|k| corners[usize::from(k)])));
        }
        // Apart from the loop above, whose branches nobody can foresee: here the processor waits for many voxels at once.
        let lattice = Lattice { corner: key.block().map(|c| f64::from(c) * SIDE as f64), blocks, scale };
        let mut torn = false;
        patch.vertices.reserve(self.edges.len());
        for &edge in &self.edges {
            self.vertex[usize::from(edge)] = NEW;
            let vertex = lattice.vertex(usize::from(edge));
            patch.steps |= 1 << vertex.step;
            torn |= vertex.torn;
            patch.vertices.push(vertex);
        }
        if torn {
            let triangles = self.cells.iter().map(|&(_, case)| cases[usize::from(case)].triangles.len());
            patch.drop_torn(triangles);
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

    /// Takes away the cells that have a torn vertex, then all vertices without a face. `triangles` has how many faces each
    /// cell has.
    #[cold]
    fn drop_torn(&mut self, triangles: impl Iterator<Item = usize>) {
        let Self { vertices, faces, .. } = self;
        let mut rest = std::mem::take(faces).into_iter();
        for count in triangles {
            let cell: Vec<_> = rest.by_ref().take(count).collect();
            if !cell.as_flattened().iter().any(|&k| vertices[usize::from(k)].torn) {
                faces.extend(cell);
            }
        }
        let mut names = vec![NEW; vertices.len()];
        let mut kept = Vec::new();
        for k in faces.as_flattened_mut() {
            let name = &mut names[usize::from(*k)];
            if *name == NEW {
                *name = kept.len() as u16;
                kept.push(vertices[usize::from(*k)]);
            }
            *k = *name;
        }
        *vertices = kept;
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

/// What a patch must know about its map.
pub(crate) struct Scale {
    voxel_size: f64,
    /// In steps of the stored distance.
    most_rise: f64,
}

impl Scale {
    pub(crate) fn new(settings: &Settings) -> Self {
        let voxel = f64::from(ONE) / settings.truncation_voxels;
        Self { voxel_size: settings.voxel_size, most_rise: MOST_RISE * voxel }
    }
}

/// The voxels of a block and the first ones of those above it.
struct Lattice<'a> {
    /// The first voxel of the block.
    corner: [f64; 3],
    blocks: &'a [&'a Block; 8],
    scale: &'a Scale,
}

impl Lattice<'_> {
    fn vertex(&self, edge: usize) -> Vertex {
        let (point, axis) = (edge / 3, edge % 3);
        let at = [point % LATTICE, point / LATTICE % LATTICE, point / (LATTICE * LATTICE)];
        let mut beyond = at;
        beyond[axis] += 1;
        let ([step, voxel], [other_step, other]) = (place(at), place(beyond));
        let ends = [(self.blocks[step], voxel), (self.blocks[other_step], other)];
        // The ratio of means by the ratio of sums, whose difference is exact: t = a / (a - b).
        let [(s0, w0), (s1, w1)] = ends.map(|(block, k)| (i64::from(block.distance[k]), i64::from(block.weight[k])));
        let (a, b) = (s0 * w1, s1 * w0);
        let rise = (a - b) as f64;
        let t = a as f64 / rise;
        let position = [0, 1, 2].map(|k| {
            let along = if k == axis { t } else { 0.0 };
            ((self.corner[k] + at[k] as f64 + 0.5 + along) * self.scale.voxel_size) as f32
        });
        Vertex {
            position,
            normal: [0.0; 3],
            colour: blend(ends.map(|(block, voxel)| block.colour[voxel].map(f32::from)), t as f32),
            outward: axis as u8 | u8::from(a < b) << 2,
            step: step as u8,
            edge: EdgeSet::edge(voxel, axis) as u16,
            torn: rise.abs() > self.scale.most_rise * (w0 * w1) as f64,
        }
    }
}

/// The block of a point of the lattice, and the voxel there.
fn place(at: [usize; 3]) -> [usize; 2] {
    let step = (0..3).fold(0, |step, k| step | (at[k] / SIDE) << k);
    [step, (at[0] % SIDE + SIDE * (at[1] % SIDE + SIDE * (at[2] % SIDE))) % VOXELS]
}

/// The mean colour at `t` between two voxels, from their sums and counts; that of one where the other has none.
fn blend([a, b]: [[f32; 4]; 2], t: f32) -> [u8; 3] {
    let t = if b[3] == 0.0 { 0.0 } else { t };
    let t = if a[3] == 0.0 { 1.0 } else { t };
    if a[3] + b[3] == 0.0 {
        return UNSEEN;
    }
    // Six bits to eight; a count of none only meets a share of zero.
    let scale = 255.0 / 63.0;
    let (share, other) = ((1.0 - t) * scale / a[3].max(1.0), t * scale / b[3].max(1.0));
    [0, 1, 2].map(|k| (a[k] * share + b[k] * other + 0.5) as u8)
}

#[cfg(test)]
mod tests {
    use super::{UNSEEN, blend};

    #[test]
    fn colours_are_means_of_six_bits() {
        // Sums of three and of one observation: 10 and 31 of 63.
        let (three, one, none) = ([30.0, 0.0, 189.0, 3.0], [31.0, 63.0, 0.0, 1.0], [0.0; 4]);
        assert_eq!(blend([three, none], 0.7), [40, 0, 255]);
        assert_eq!(blend([none, one], 0.2), [125, 255, 0]);
        // (10 + (31 - 10) / 3) 255 / 63 = 68.8.
        assert_eq!(blend([three, one], 1.0 / 3.0), [69, 85, 170]);
        assert_eq!(blend([none, none], 0.5), UNSEEN);
    }
}
