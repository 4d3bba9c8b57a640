//! What a separation has to know of paints and wall.

/// Largest number of paints that a separation weighs against each other.
pub const MOST_PAINTS: usize = 12;

/// How films of several paints look on each pixel of a wall: Kubelka-Munk films over each other, a wet mixture, a measured table.
pub trait MixingModel: Sync {
    /// How many paints there are, at most [`MOST_PAINTS`].
    fn paints(&self) -> usize;

    /// CIELAB of a pixel under one depth per paint, and its derivative by each of them in `slopes`, which is as long.
    fn lab(&self, pixel: usize, depths: &[f64], slopes: &mut [[f64; 3]]) -> [f64; 3];
}
