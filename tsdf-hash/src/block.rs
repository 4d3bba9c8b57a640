//! Eight voxels cubed, 14 bytes each.

use crate::key::mix;

/// Voxels along the edge of a block.
pub(crate) const SIDE: usize = 8;
/// Voxels of a block.
pub(crate) const VOXELS: usize = SIDE * SIDE * SIDE;
/// The normalised distance 1 as an integer: `65535 * 32767 < 2^31`, so a sum can never overflow before its weight does.
pub(crate) const ONE: i32 = 32767;
/// Largest weight of one observation.
pub(crate) const MAX_WEIGHT: f32 = 15.0;
/// Coloured frames that fit one voxel: `1040 * 63 < 2^16`.
pub(crate) const MAX_COLOURS: u16 = 1040;

/// Sums over observations, never averages: adding and subtracting commute, so the order of the frames does not matter
/// and any of them can be taken out again. Voxel `(x, y, z)` of the block is entry `x + 8 (y + 8 z)`.
#[derive(Clone, PartialEq, Eq)]
pub(crate) struct Block {
    /// `S = Σ w q`, with `q = round(32767 sdf / μ)`.
    pub(crate) distance: [i32; VOXELS],
    /// `W = Σ w`, with `w` in `1..=15`.
    pub(crate) weight: [u16; VOXELS],
    /// Sums of R, G, B in six bits, and the number of coloured observations.
    pub(crate) colour: [[u16; 4]; VOXELS],
}

impl Block {
    pub(crate) const ZERO: Self = Self { distance: [0; VOXELS], weight: [0; VOXELS], colour: [[0; 4]; VOXELS] };

    pub(crate) fn is_empty(&self) -> bool {
        self.weight.iter().fold(0, |all, w| all | w) == 0
    }

    /// Mean normalised distance of a voxel, `-1..=1`; `None` where nothing was observed.
    pub(crate) fn mean(&self, voxel: usize) -> Option<f32> {
        let weight = self.weight[voxel];
        (weight > 0).then(|| self.distance[voxel] as f32 / (f32::from(weight) * ONE as f32))
    }

    /// Mean colour of a voxel, R G B in `0..=255`; `None` where none was observed.
    pub(crate) fn mean_colour(&self, voxel: usize) -> Option<[f32; 3]> {
        let [r, g, b, n] = self.colour[voxel].map(f32::from);
        (n > 0.0).then(|| [r, g, b].map(|sum| sum * (255.0 / 63.0) / n))
    }

    /// Adds another block, wrapping; returns whether a counter ran over.
    pub(crate) fn add(&mut self, other: &Self) -> bool {
        let mut fault = false;
        for (sum, more) in self.distance.iter_mut().zip(&other.distance) {
            *sum = sum.wrapping_add(*more);
        }
        for (sum, more) in self.weight.iter_mut().zip(&other.weight) {
            let (next, over) = sum.overflowing_add(*more);
            *sum = next;
            fault |= over;
        }
        for (sums, more) in self.colour.iter_mut().zip(&other.colour) {
            for (sum, more) in sums.iter_mut().zip(more) {
                let (next, over) = sum.overflowing_add(*more);
                *sum = next;
                fault |= over;
            }
            fault |= sums[3] > MAX_COLOURS;
        }
        fault
    }

    /// Takes another block out, wrapping; returns whether it cannot have been in.
    pub(crate) fn subtract(&mut self, other: &Self) -> bool {
        let mut fault = false;
        for voxel in 0..VOXELS {
            let (weight, under) = self.weight[voxel].overflowing_sub(other.weight[voxel]);
            let distance = self.distance[voxel].wrapping_sub(other.distance[voxel]);
            (self.weight[voxel], self.distance[voxel]) = (weight, distance);
            fault |= under || i64::from(distance).abs() > i64::from(weight) * i64::from(ONE);
            for (sum, less) in self.colour[voxel].iter_mut().zip(&other.colour[voxel]) {
                let (next, under) = sum.overflowing_sub(*less);
                *sum = next;
                fault |= under;
            }
        }
        fault
    }

    /// The largest weight and the largest number of coloured observations: sums of blocks whose peaks do not run over
    /// together do not run over.
    pub(crate) fn peaks(&self) -> [u16; 2] {
        let weight = self.weight.iter().fold(0, |most, &w| most.max(w));
        [weight, self.colour.iter().fold(0, |most, c| most.max(c[3]))]
    }

    /// A linear form of all voxels modulo 2^64: the print of a sum of blocks is the sum of their prints, so copies that
    /// lie in several places need not be brought together. A change of a single voxel always changes it.
    pub(crate) fn print(&self) -> u64 {
        let mut print = 0_u64;
        for (voxel, factors) in FACTORS.iter().enumerate() {
            let [r, g, b, n] = self.colour[voxel].map(u64::from);
            let sums = i64::from(self.distance[voxel]).cast_unsigned();
            let sums = sums.wrapping_add(u64::from(self.weight[voxel]) << 32);
            let colour = r | g << 16 | b << 32 | n << 48;
            print = print.wrapping_add(sums.wrapping_mul(factors[0])).wrapping_add(colour.wrapping_mul(factors[1]));
        }
        print
    }
}

/// Odd, so that multiplication loses nothing.
const FACTORS: [[u64; 2]; VOXELS] = {
    let mut factors = [[0; 2]; VOXELS];
    let mut n = 0;
    while n < 2 * VOXELS {
        factors[n / 2][n % 2] = mix(n as u64 + 1) | 1;
        n += 1;
    }
    factors
};

#[cfg(test)]
mod tests {
    use super::{Block, MAX_COLOURS, ONE, VOXELS};

    #[test]
    fn the_sums_cannot_overflow_before_their_counters() {
        assert!(i64::from(ONE) * i64::from(u16::MAX) <= i64::from(i32::MAX));
        assert!(MAX_COLOURS.checked_mul(63).is_some());
        assert_eq!(size_of::<Block>(), 14 * VOXELS);
    }
}
