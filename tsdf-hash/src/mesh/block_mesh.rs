//! The mesh of one block: the triangles in its cells.
//!
//! It depends on its block and on the first voxels of the seven blocks above it, and on nothing else: when a block
//! changes, the meshes of eight do. Vertices at the upper borders occur in up to four meshes, the same in each to the bit,
//! under one number.

use nalgebra::Vector3;

use crate::blocks::block_key::BlockKey;
use crate::blocks::sign_bits::SignBits;
use crate::blocks::voxel_block::{ONE, SIDE, VoxelBlock};
use crate::mesh::cell_cases::CornerRows;
use crate::mesh::edge_set::EdgeSet;
use crate::mesh::lattice::corner;
use crate::mesh::marching_cubes::Case;
use crate::settings::Settings;

/// Colour of vertices that no colour image has seen.
const UNSEEN: [u8; 3] = [128; 3];
/// Edges between the corners of the cells of a block, as far as their names go.
const EDGES: usize = corner([SIDE; 3]) + 4;
const NEW: u16 = u16::MAX;
/// No distance changes by more than a voxel from one voxel to the next. Where its mean changes by more than this many
/// (ours), no surface lies between the two: they were seen from two sides, and one of them through something.
const MAX_STEP: f64 = 1.75;

/// Where the surface cuts an edge.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Vertex {
    /// In the world, metres.
    pub(crate) position: [f32; 3],
    /// Sum over the triangles of the mesh around it, of twice their areas times their normals.
    pub(crate) normal: [f32; 3],
    pub(crate) colour: [u8; 3],
    /// The axis of the edge; bit 2 is set where its upper end is the free one: the normal of last resort.
    pub(crate) outward: u8,
    /// The block the edge belongs to, that of its lower end: at `+1` along x (bit 0), y (bit 1), z (bit 2).
    pub(crate) step: u8,
    /// Its name in that block.
    pub(crate) edge: u16,
    /// The distance jumps here: see [`MAX_STEP`].
    discontinuous: bool,
}

/// The triangles in the cells of a block.
#[derive(Default)]
pub(crate) struct BlockMesh {
    pub(crate) vertices: Vec<Vertex>,
    pub(crate) faces: Vec<[u16; 3]>,
    /// Bit `n` is set where a vertex belongs to the block at step `n`.
    pub(crate) steps: u8,
}

/// Working memory for making meshes.
pub(crate) struct BlockMesher {
    /// Vertex on an edge of the lattice.
    vertex: Vec<u16>,
    /// Crossed cells by their lowest corners, and the edges that are cut.
    cells: Vec<(u16, u8)>,
    edges: Vec<u16>,
    ends: Vec<EdgeEnds>,
}

/// The voxels at the lower and the upper end of an edge.
struct EdgeEnds {
    distance: [i32; 2],
    weight: [u16; 2],
    colour: [[u16; 4]; 2],
}

impl BlockMesher {
    pub(crate) fn new() -> Self {
        Self { vertex: vec![NEW; EDGES], cells: Vec::new(), edges: Vec::new(), ends: Vec::new() }
    }

    /// Finds the cells that the surface crosses and returns the blocks that their corners lie in, bit `n` for step `n`.
    pub(crate) fn find(&mut self, signs: &[Option<SignBits>; 8]) -> u8 {
        self.cells.clear();
        let mut blocks = 0;
        CornerRows::with_border(signs).crossed(|cell, case| {
            self.cells.push((corner(cell) as u16, case));
            // The steps that this cell takes beyond the block, in any combination.
            blocks |= [0b1, 0b11, 0b101, 0b1111, 0b1_0001, 0b11_0011, 0b101_0101, 0xff]
                [(0..3).fold(0, |steps, k| steps | usize::from(cell[k] + 1 == SIDE) << k)];
        });
        blocks
    }

    /// Makes the mesh of the cells that were found; `blocks` are those that their corners lie in.
    pub(crate) fn make(
        &mut self,
        mesh: &mut BlockMesh,
        key: BlockKey,
        blocks: &[&VoxelBlock; 8],
        cases: &[Case],
        scale: &MeshScale,
    ) {
        mesh.clear();
        self.edges.clear();
        mesh.faces.reserve(2 * self.cells.len());
        for &(cell, case) in &self.cells {
            let case = &cases[usize::from(case)];
            let mut corners = [0; 12];
            for (corner, &edge) in corners.iter_mut().zip(&case.edges) {
                let edge = cell + edge;
                let vertex = &mut self.vertex[usize::from(edge)];
                if *vertex == NEW {
                    *vertex = self.edges.len() as u16;
                    self.edges.push(edge);
                }
                *corner = *vertex;
            }
            mesh.faces.extend(case.triangles.iter().map(|triangle| triangle.map(|k| corners[usize::from(k)])));
        }
        // Apart from the loop above, whose branches cannot be predicted, and from the arithmetic: here the processor waits for
        // many voxels at once.
        self.ends.clear();
        self.ends.extend(self.edges.iter().map(|&edge| EdgeEnds::read(usize::from(edge), blocks)));
        let grid = Grid::new(key, scale);
        let mut discontinuous = false;
        mesh.vertices.reserve(self.edges.len());
        for (&edge, ends) in self.edges.iter().zip(&self.ends) {
            self.vertex[usize::from(edge)] = NEW;
            let vertex = grid.vertex(usize::from(edge), ends);
            mesh.steps |= 1 << vertex.step;
            discontinuous |= vertex.discontinuous;
            mesh.vertices.push(vertex);
        }
        if discontinuous {
            let triangles = self.cells.iter().map(|&(_, case)| cases[usize::from(case)].triangles.len());
            mesh.drop_discontinuous(triangles);
        }
        mesh.add_normals();
    }
}

impl BlockMesh {
    pub(crate) fn clear(&mut self) {
        self.vertices.clear();
        self.faces.clear();
        self.steps = 0;
    }

    /// Takes away the cells that have a discontinuous vertex, then all vertices without a face. `triangles` has how many faces each
    /// cell has.
    #[cold]
    fn drop_discontinuous(&mut self, triangles: impl Iterator<Item = usize>) {
        let Self { vertices, faces, .. } = self;
        let mut rest = std::mem::take(faces).into_iter();
        for count in triangles {
            let cell: Vec<_> = rest.by_ref().take(count).collect();
            if !cell.as_flattened().iter().any(|&k| vertices[usize::from(k)].discontinuous) {
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
        for &[a, b, c] in &self.faces {
            let at = |k: u16| Vector3::from(self.vertices[usize::from(k)].position);
            let first = at(a);
            let normal = (at(b) - first).cross(&(at(c) - first));
            for k in [a, b, c] {
                let sum = &mut self.vertices[usize::from(k)].normal;
                *sum = [sum[0] + normal.x, sum[1] + normal.y, sum[2] + normal.z];
            }
        }
    }
}

/// What a mesh must know about its map.
pub(crate) struct MeshScale {
    voxel_size: f64,
    /// In steps of the stored distance.
    max_step: f64,
}

impl MeshScale {
    pub(crate) fn new(settings: &Settings) -> Self {
        let voxel = f64::from(ONE) / settings.truncation_voxels;
        Self { voxel_size: settings.voxel_size, max_step: MAX_STEP * voxel }
    }
}

impl EdgeEnds {
    #[inline(always)]
    fn read(edge: usize, blocks: &[&VoxelBlock; 8]) -> Self {
        let ([step, voxel], [other_step, other]) = (place(edge), place(edge + (4 << (4 * (edge & 3)))));
        let (lower, upper) = (blocks[step], blocks[other_step]);
        Self {
            distance: [lower.distance[voxel], upper.distance[other]],
            weight: [lower.weight[voxel], upper.weight[other]],
            colour: [lower.colour[voxel], upper.colour[other]],
        }
    }
}

/// The block of a corner or of the lower end of an edge, and the voxel there.
#[inline(always)]
fn place(name: usize) -> [usize; 2] {
    let [x, y, z] = [name >> 2 & 15, name >> 6 & 15, name >> 10 & 15];
    let step = (x / SIDE) | ((y / SIDE) << 1) | ((z / SIDE) << 2);
    [step & 7, x % SIDE + SIDE * (y % SIDE + SIDE * (z % SIDE))]
}

/// Where the corners of the cells of a block are.
struct Grid<'a> {
    /// Coordinates in voxels, for each axis, and in metres.
    voxels: [[f64; 16]; 3],
    metres: [[f32; 16]; 3],
    scale: &'a MeshScale,
}

impl<'a> Grid<'a> {
    fn new(key: BlockKey, scale: &'a MeshScale) -> Self {
        let mut grid = Self { voxels: [[0.0; 16]; 3], metres: [[0.0; 16]; 3], scale };
        for (axis, c) in key.block().into_iter().enumerate() {
            for n in 0..=SIDE {
                let at = f64::from(c) * SIDE as f64 + n as f64 + 0.5;
                grid.voxels[axis][n] = at;
                grid.metres[axis][n] = (at * scale.voxel_size) as f32;
            }
        }
        grid
    }

    #[inline(always)]
    fn vertex(&self, edge: usize, ends: &EdgeEnds) -> Vertex {
        let ([step, voxel], axis) = (place(edge), (edge & 3).min(2));
        // The ratio of means by the ratio of sums, whose difference is exact: t = a / (a - b). All are below 2^48.
        let a = f64::from(ends.distance[0]) * f64::from(ends.weight[1]);
        let b = f64::from(ends.distance[1]) * f64::from(ends.weight[0]);
        let t = a / (a - b);
        let at = [edge >> 2 & 15, edge >> 6 & 15, edge >> 10 & 15];
        let mut position = [self.metres[0][at[0]], self.metres[1][at[1]], self.metres[2][at[2]]];
        position[axis] = ((self.voxels[axis][at[axis]] + t) * self.scale.voxel_size) as f32;
        Vertex {
            position,
            normal: [0.0; 3],
            colour: blend(ends.colour, t as f32),
            outward: axis as u8 | u8::from(a < b) << 2,
            step: step as u8,
            edge: EdgeSet::edge(voxel, axis) as u16,
            discontinuous: (a - b).abs() > self.scale.max_step * f64::from(ends.weight[0]) * f64::from(ends.weight[1]),
        }
    }
}

/// The mean colour at `t` between two voxels, from their sums and counts; that of one where the other has none.
#[inline(always)]
fn blend([a, b]: [[u16; 4]; 2], t: f32) -> [u8; 3] {
    let t = if b[3] == 0 { 0.0 } else { t };
    let t = if a[3] == 0 { 1.0 } else { t };
    if a[3] | b[3] == 0 {
        return UNSEEN;
    }
    // Six bits to eight; a count of none only meets a share of zero.
    let scale = 255.0 / 63.0;
    let (share, other) = ((1.0 - t) * scale / f32::from(a[3].max(1)), t * scale / f32::from(b[3].max(1)));
    let mut colour = [0; 3];
    for (k, colour) in colour.iter_mut().enumerate() {
        *colour = (f32::from(a[k]) * share + f32::from(b[k]) * other + 0.5) as u8;
    }
    colour
}

#[cfg(test)]
mod tests {
    use super::{UNSEEN, blend};

    #[test]
    fn colours_are_means_of_six_bits() {
        // Sums of three and of one observation: 10 and 31 of 63.
        let (three, one, none) = ([30, 0, 189, 3], [31, 63, 0, 1], [0; 4]);
        assert_eq!(blend([three, none], 0.7), [40, 0, 255]);
        assert_eq!(blend([none, one], 0.2), [125, 255, 0]);
        // (10 + (31 - 10) / 3) 255 / 63 = 68.8.
        assert_eq!(blend([three, one], 1.0 / 3.0), [69, 85, 170]);
        assert_eq!(blend([none, none], 0.5), UNSEEN);
    }
}
