//! The surface as a welded triangle mesh.

mod cases;
mod cells;
mod ply;
mod weld;

use cases::Cases;
use cells::{Cells, owner};
use nalgebra::Vector3;
pub use ply::write_ply;
use weld::EdgeSet;

use crate::Map;
use crate::block::{Block, SIDE};

/// Colour of vertices that no colour image has seen.
const UNSEEN: [u8; 3] = [128; 3];

/// A triangle mesh; `positions`, `normals` and `colours` have one entry per vertex, and no two vertices belong to the
/// same voxel edge.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Vertices in the world, metres.
    pub positions: Vec<[f32; 3]>,
    /// Triangles, counter-clockwise seen from the free side (where the camera was).
    pub faces: Vec<[u32; 3]>,
    /// Unit normals into the free side: the mean of the neighbouring triangles, by area.
    pub normals: Vec<[f32; 3]>,
    /// R, G, B; mid-grey where no colour was seen.
    pub colours: Vec<[u8; 3]>,
}

impl Map {
    /// The zero level of the field by marching cubes, where all eight voxels of a cell have been observed.
    ///
    /// Vertices and faces come in the order of the block coordinates, so equal maps give equal meshes. The sign test is
    /// "solid where the distance is below zero". Every edge has at most two faces.
    pub fn mesh(&self) -> Mesh {
        let cells = Cells::find(self.store());
        let mut edges = vec![EdgeSet::EMPTY; cells.blocks.len()];
        let cases = Cases::new();
        for cell in cells.iter() {
            for edge in cases.triangles(cell.case).iter().flatten() {
                let (block, name) = owner(&cells.blocks[cell.block], cell.voxel, *edge);
                edges[block].insert(name);
            }
        }
        let mut next = 0;
        for set in &mut edges {
            next = set.number(next);
        }
        let mut mesh = Mesh::default();
        mesh.positions.reserve(next as usize);
        mesh.colours.reserve(next as usize);
        // Unit vectors along the edges, towards the free end: the normal of last resort.
        let mut outward = Vec::with_capacity(next as usize);
        for (block, set) in edges.iter().enumerate() {
            for edge in set.edges() {
                let vertex = self.vertex(&cells, block, edge);
                mesh.positions.push(vertex.position);
                mesh.colours.push(vertex.colour);
                outward.push(vertex.outward);
            }
        }
        mesh.faces.reserve(cells.len() * 2);
        for cell in cells.iter() {
            for triangle in cases.triangles(cell.case) {
                mesh.faces.push(triangle.map(|edge| {
                    let (block, name) = owner(&cells.blocks[cell.block], cell.voxel, edge);
                    edges[block].vertex(name)
                }));
            }
        }
        mesh.normals = normals(&mesh, &outward);
        mesh
    }

    /// Where the surface crosses an edge.
    fn vertex(&self, cells: &Cells, block: usize, edge: usize) -> Vertex {
        let (voxel, axis) = (edge / 3, edge % 3);
        let at = [voxel % SIDE, voxel / SIDE % SIDE, voxel / (SIDE * SIDE)];
        let here = &cells.blocks[block];
        // The other end lies in this block or in the next one along the axis.
        let stride = [1, SIDE, SIDE * SIDE][axis];
        let (there, other) = if at[axis] + 1 < SIDE {
            (here, voxel + stride)
        } else {
            (&cells.blocks[here.upper[1 << axis] as usize], voxel - (SIDE - 1) * stride)
        };
        let ends = [(here.slot, voxel), (there.slot, other)].map(|(slot, voxel)| (self.store().block(slot), voxel));
        let [a, b] = ends.map(|(block, voxel)| block.and_then(|block| block.mean(voxel)).unwrap_or(0.0));
        let t = a / (a - b);
        let h = self.settings().voxel_size;
        let corner = here.key.block();
        let position = [0, 1, 2].map(|k| {
            let along = if k == axis { f64::from(t) } else { 0.0 };
            ((f64::from(corner[k]) * SIDE as f64 + at[k] as f64 + 0.5 + along) * h) as f32
        });
        let mut outward = [0.0; 3];
        outward[axis] = if a < b { 1.0 } else { -1.0 };
        Vertex { position, outward, colour: blend(ends, t) }
    }
}

struct Vertex {
    position: [f32; 3],
    outward: [f32; 3],
    colour: [u8; 3],
}

fn blend(ends: [(Option<&Block>, usize); 2], t: f32) -> [u8; 3] {
    match ends.map(|(block, voxel)| block.and_then(|block| block.mean_colour(voxel))) {
        [Some(a), Some(b)] => [0, 1, 2].map(|k| (a[k] + t * (b[k] - a[k])).round() as u8),
        [Some(one), None] | [None, Some(one)] => one.map(|c| c.round() as u8),
        [None, None] => UNSEEN,
    }
}

/// Mean normals of the triangles around each vertex; their length before normalising is twice their area.
fn normals(mesh: &Mesh, outward: &[[f32; 3]]) -> Vec<[f32; 3]> {
    let mut sums = vec![Vector3::<f32>::zeros(); mesh.positions.len()];
    for face in &mesh.faces {
        let [a, b, c] = face.map(|k| Vector3::from(mesh.positions[k as usize]));
        let normal = (b - a).cross(&(c - a));
        for &k in face {
            sums[k as usize] += normal;
        }
    }
    sums.iter().zip(outward).map(|(sum, &fallback)| sum.try_normalize(1e-20).map_or(fallback, Into::into)).collect()
}
