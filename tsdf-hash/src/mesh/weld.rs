//! Welding: the meshes of blocks into one, with one vertex per cut edge.

use crate::blocks::block_key::BlockKey;
use crate::blocks::block_table::BlockTable;
use crate::derived_blocks::Derived;
use crate::mesh::block_mesh::BlockMesh;
use crate::mesh::edge_set::EdgeSet;
use crate::mesh::triangle_mesh::Mesh;

/// One mesh of the meshes of all blocks: vertices in the order of their blocks and edges, faces in the order of the blocks and cells.
pub(crate) fn weld(meshes: &BlockTable<Derived<BlockMesh>>) -> Mesh {
    let mut order: Vec<(BlockKey, u32)> = meshes.keys().iter().copied().zip(0..).collect();
    order.sort_unstable();
    let mut edges = vec![EdgeSet::EMPTY; order.len()];
    let owners: Vec<[u32; 8]> = order.iter().map(|&(key, slot)| owners(meshes, key, slot)).collect();
    for (&(_, slot), owners) in order.iter().zip(&owners) {
        for vertex in &meshes.values()[slot as usize].data.vertices {
            edges[owners[usize::from(vertex.step)] as usize].insert(usize::from(vertex.edge));
        }
    }
    let count = order.iter().fold(0, |next, &(_, slot)| edges[slot as usize].number(next)) as usize;
    let mut mesh = Mesh {
        positions: vec![[0.0; 3]; count],
        faces: Vec::with_capacity(meshes.values().iter().map(|block| block.data.faces.len()).sum()),
        normals: vec![[0.0; 3]; count],
        colours: vec![[0; 3]; count],
    };
    let mut outward = vec![0; count];
    let mut numbers = Vec::new();
    for (&(_, slot), owners) in order.iter().zip(&owners) {
        let block = &meshes.values()[slot as usize].data;
        numbers.clear();
        for vertex in &block.vertices {
            let number = edges[owners[usize::from(vertex.step)] as usize].vertex(usize::from(vertex.edge));
            let at = number as usize;
            mesh.positions[at] = vertex.position;
            mesh.colours[at] = vertex.colour;
            mesh.normals[at] = [0, 1, 2].map(|k| mesh.normals[at][k] + vertex.normal[k]);
            outward[at] = vertex.outward;
            numbers.push(number);
        }
        mesh.faces.extend(block.faces.iter().map(|face| face.map(|k| numbers[usize::from(k)])));
    }
    for (normal, &outward) in mesh.normals.iter_mut().zip(&outward) {
        *normal = unit(*normal).unwrap_or_else(|| along(outward));
    }
    mesh
}

/// Slots of the blocks that own the vertices of a block. Where its mesh has a vertex, the block of its lower end exists.
fn owners(meshes: &BlockTable<Derived<BlockMesh>>, key: BlockKey, slot: u32) -> [u32; 8] {
    let mut owners = [slot; 8];
    for n in (1..8).filter(|n| meshes.values()[slot as usize].data.steps >> n & 1 == 1) {
        let owner = key.neighbour([n & 1, n >> 1 & 1, n >> 2]).and_then(|key| meshes.slot(key));
        owners[n as usize] = owner.map_or(slot, |slot| slot as u32);
    }
    owners
}

pub(crate) fn unit(v: [f32; 3]) -> Option<[f32; 3]> {
    let norm = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
    (norm > 1e-20).then(|| v.map(|c| c / norm))
}

/// The unit vector along an edge, towards its free end.
pub(crate) fn along(outward: u8) -> [f32; 3] {
    let mut unit = [0.0; 3];
    unit[usize::from(outward & 3)] = if outward & 4 == 0 { -1.0 } else { 1.0 };
    unit
}
