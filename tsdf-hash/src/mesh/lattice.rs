//! Numbers for the corners and edges of the cells of a block.

/// The number of a corner, from its coordinates `0..=8`: four bits each, above two for the axis of an edge that leaves it.
/// Numbers add up as coordinates do.
pub(crate) const fn corner(at: [usize; 3]) -> usize {
    at[0] << 2 | at[1] << 6 | at[2] << 10
}
