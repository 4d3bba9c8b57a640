//! Which edges of a block the surface cuts.

use crate::blocks::voxel_block::VOXELS;

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

    /// The number of the edge that leaves `voxel` along `axis`.
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
