//! Pieces of a mesh that is followed: what a viewer must draw again.

use std::collections::BTreeSet;

use crate::blocks::block_key::BlockKey;
use crate::blocks::block_table::BlockTable;
use crate::derived_blocks::Derived;
use crate::mesh::block_mesh::BlockMesh;
use crate::mesh::triangle_mesh::Mesh;
use crate::mesh::weld::{along, unit};

/// Blocks along each side of a patch (ours): 64 voxels.
const SIDE: i32 = 8;

/// A cube of blocks, by its place in the lattice of cubes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PatchKey(pub [i32; 3]);

impl PatchKey {
    fn of(key: BlockKey) -> Self {
        Self(key.block().map(|c| c.div_euclid(SIDE)))
    }
}

/// The patches that have changed since they were last asked for.
#[derive(Debug, Default)]
pub(crate) struct ChangedPatches(BTreeSet<PatchKey>);

impl ChangedPatches {
    pub(crate) fn add(&mut self, key: BlockKey) {
        self.0.insert(PatchKey::of(key));
    }

    pub(crate) fn take(&mut self) -> Vec<PatchKey> {
        std::mem::take(&mut self.0).into_iter().collect()
    }
}

/// The patches that some blocks are in, in their order.
pub(crate) fn patches_of<'a>(blocks: impl Iterator<Item = &'a BlockKey>) -> Vec<PatchKey> {
    let all: BTreeSet<PatchKey> = blocks.map(|key| PatchKey::of(*key)).collect();
    all.into_iter().collect()
}

/// The mesh of a patch, not welded.
pub(crate) fn patch(meshes: &BlockTable<Derived<BlockMesh>>, patch: PatchKey) -> Mesh {
    let mut mesh = Mesh::default();
    let first = patch.0.map(|c| c * SIDE);
    for n in 0..SIDE * SIDE * SIDE {
        let block = [first[0] + n % SIDE, first[1] + n / SIDE % SIDE, first[2] + n / (SIDE * SIDE)];
        let Some(block) = BlockKey::new(block).and_then(|key| meshes.get(key)) else { continue };
        let start = mesh.positions.len() as u32;
        for vertex in &block.data.vertices {
            mesh.positions.push(vertex.position);
            mesh.normals.push(unit(vertex.normal).unwrap_or_else(|| along(vertex.outward)));
            mesh.colours.push(vertex.colour);
        }
        mesh.faces.extend(block.data.faces.iter().map(|face| face.map(|k| start + u32::from(k))));
    }
    mesh
}
