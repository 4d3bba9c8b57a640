//! One vertex per cut edge, whichever patch asks.

use super::Mesh;
use super::patch::Patch;
use crate::block::VOXELS;
use crate::key::Key;
use crate::slots::Slots;

const WORDS: usize = 3 * VOXELS / 64;

/// The cut edges of one block: an edge belongs to the block of its lower corner. Vertices are numbered in the order of
/// the edges, so a number is a count of bits.
#[derive(Clone)]
pub(crate) struct EdgeSet {
    bits: [u64; WORDS],
    /// Number of the first vertex of each word.
    base: [u32; WORDS],
}

impl EdgeSet {
    pub(crate) const EMPTY: Self = Self { bits: [0; WORDS], base: [0; WORDS] };

    /// The name of the edge that leaves `voxel` along `axis`.
    pub(crate) fn edge(voxel: usize, axis: usize) -> usize {
        3 * voxel + axis
    }

    pub(crate) fn insert(&mut self, edge: usize) {
        self.bits[edge / 64] |= 1 << (edge % 64);
    }

    /// Numbers the vertices from `first` on and returns the next free number.
    pub(crate) fn number(&mut self, first: u32) -> u32 {
        let mut next = first;
        for (base, bits) in self.base.iter_mut().zip(&self.bits) {
            *base = next;
            next += bits.count_ones();
        }
        next
    }

    pub(crate) fn vertex(&self, edge: usize) -> u32 {
        let below = self.bits[edge / 64] & ((1 << (edge % 64)) - 1);
        self.base[edge / 64] + below.count_ones()
    }
}

/// One mesh of all patches: vertices in the order of their blocks and edges, faces in the order of the blocks and cells.
pub(crate) fn weld(patches: &Slots<Patch>) -> Mesh {
    let mut order: Vec<(Key, u32)> = patches.keys().iter().copied().zip(0..).collect();
    order.sort_unstable();
    let mut edges = vec![EdgeSet::EMPTY; order.len()];
    let owners: Vec<[u32; 8]> = order.iter().map(|&(key, slot)| owners(patches, key, slot)).collect();
    for (&(_, slot), owners) in order.iter().zip(&owners) {
        for vertex in &patches.values()[slot as usize].vertices {
            edges[owners[usize::from(vertex.step)] as usize].insert(usize::from(vertex.edge));
        }
    }
    let count = order.iter().fold(0, |next, &(_, slot)| edges[slot as usize].number(next)) as usize;
    let mut mesh = Mesh {
        positions: vec![[0.0; 3]; count],
        faces: Vec::with_capacity(patches.values().iter().map(|patch| patch.faces.len()).sum()),
        normals: vec![[0.0; 3]; count],
        colours: vec![[0; 3]; count],
    };
    let mut outward = vec![0; count];
    let mut numbers = Vec::new();
    for (&(_, slot), owners) in order.iter().zip(&owners) {
        let patch = &patches.values()[slot as usize];
        numbers.clear();
        for vertex in &patch.vertices {
            let number = edges[owners[usize::from(vertex.step)] as usize].vertex(usize::from(vertex.edge));
            let at = number as usize;
            mesh.positions[at] = vertex.position;
            mesh.colours[at] = vertex.colour;
            mesh.normals[at] = [0, 1, 2].map(|k| mesh.normals[at][k] + vertex.normal[k]);
            outward[at] = vertex.outward;
            numbers.push(number);
        }
        mesh.faces.extend(patch.faces.iter().map(|face| face.map(|k| numbers[usize::from(k)])));
    }
    for (normal, &outward) in mesh.normals.iter_mut().zip(&outward) {
        *normal = unit(*normal).unwrap_or_else(|| along(outward));
    }
    mesh
}

/// Slots of the blocks that own the vertices of a patch. Where a patch has a vertex, the block of its lower end exists.
fn owners(patches: &Slots<Patch>, key: Key, slot: u32) -> [u32; 8] {
    let mut owners = [slot; 8];
    for n in (1..8).filter(|n| patches.values()[slot as usize].steps >> n & 1 == 1) {
        let owner = key.neighbour([n & 1, n >> 1 & 1, n >> 2]).and_then(|key| patches.slot(key));
        owners[n as usize] = owner.map_or(slot, |slot| slot as u32);
    }
    owners
}

fn unit(v: [f32; 3]) -> Option<[f32; 3]> {
    let norm = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
    (norm > 1e-20).then(|| v.map(|c| c / norm))
}

/// The unit vector along an edge, towards its free end.
fn along(outward: u8) -> [f32; 3] {
    let mut unit = [0.0; 3];
    unit[usize::from(outward & 3)] = if outward & 4 == 0 { -1.0 } else { 1.0 };
    unit
}

#[cfg(test)]
mod tests {
    use super::EdgeSet;

    #[test]
    fn numbers_follow_the_edges() {
        let mut set = EdgeSet::EMPTY;
        let edges = [0, 1, 63, 64, 200, 1535];
        edges.iter().rev().for_each(|&edge| set.insert(edge));
        assert_eq!(set.number(10), 16);
        assert_eq!(edges.map(|edge| set.vertex(edge)), [10, 11, 12, 13, 14, 15]);
    }
}
