//! A block of 8³ voxels, 14 bytes each.

use crate::hashing::mix64;

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

/// A block of 8³ voxels: sums over observations, never averages.
///
/// Adding and subtracting commute, so the order of the frames does not matter and any of them can be taken out again. Voxel
/// `(x, y, z)` of the block has the number `x + 8 (y + 8 z)`, `0..512`. Who keeps a [`TsdfLayer`](crate::layer::TsdfLayer) of their
/// own fills blocks by [`add_distance`](Self::add_distance) and [`add_colour`](Self::add_colour).
#[derive(Clone, PartialEq, Eq)]
pub struct VoxelBlock {
    /// `S = Σ w q`, with `q = round(32767 sdf / μ)`.
    pub(crate) distance: [i32; VOXELS],
    /// `W = Σ w`, with `w` in `1..=15`.
    pub(crate) weight: [u16; VOXELS],
    /// Sums of R, G, B in six bits, and the number of coloured observations.
    pub(crate) colour: [[u16; 4]; VOXELS],
}

impl VoxelBlock {
    /// A block in which nothing was observed.
    pub const ZERO: Self = Self { distance: [0; VOXELS], weight: [0; VOXELS], colour: [[0; 4]; VOXELS] };

    /// Adds an observation of the distance of a voxel, as a share of the truncation distance (cut off at ±1), with its weight;
    /// `false`, and nothing has changed, if there is no such voxel or its weight would exceed 65535.
    pub fn add_distance(&mut self, voxel: usize, distance: f32, weight: u16) -> bool {
        let Some((sum, total)) = self.distance.get_mut(voxel).zip(self.weight.get_mut(voxel)) else { return false };
        let Some(more) = total.checked_add(weight).filter(|_| distance.is_finite()) else { return false };
        *total = more;
        *sum += (distance.clamp(-1.0, 1.0) * ONE as f32).round_ties_even() as i32 * i32::from(weight);
        true
    }

    /// Adds an observation of the colour of a voxel, kept in six bits per channel; `false`, and nothing has changed, if there
    /// is no such voxel or it has 1040 already.
    pub fn add_colour(&mut self, voxel: usize, rgb: [u8; 3]) -> bool {
        let Some(sums) = self.colour.get_mut(voxel).filter(|sums| sums[3] < MAX_COLOURS) else { return false };
        for (sum, c) in sums.iter_mut().zip(rgb) {
            *sum += ((u32::from(c) * 63 + 127) / 255) as u16;
        }
        sums[3] += 1;
        true
    }

    /// The sums of a voxel: `S` of the distances in steps of `μ / 32767`, `W` of the weights, and those of R, G, B in six bits
    /// with the number of coloured observations; `None` if there is no such voxel.
    pub fn sums(&self, voxel: usize) -> Option<(i32, u16, [u16; 4])> {
        Some((*self.distance.get(voxel)?, self.weight[voxel], self.colour[voxel]))
    }

    /// Sum of the weights of a voxel's observations; 0 where nothing was observed.
    pub fn weight(&self, voxel: usize) -> u16 {
        self.weight.get(voxel).copied().unwrap_or(0)
    }

    /// Mean distance of a voxel as a share of the truncation distance, `-1..=1`; `None` where nothing was observed.
    pub fn distance(&self, voxel: usize) -> Option<f32> {
        if voxel < VOXELS { self.mean(voxel) } else { None }
    }

    /// Mean colour of a voxel, R G B in `0..=255`; `None` where none was observed.
    pub fn colour(&self, voxel: usize) -> Option<[f32; 3]> {
        if voxel < VOXELS { self.mean_colour(voxel) } else { None }
    }

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
        let mut overflow = false;
        for (sum, more) in self.distance.iter_mut().zip(&other.distance) {
            *sum = sum.wrapping_add(*more);
        }
        for (sum, more) in self.weight.iter_mut().zip(&other.weight) {
            let (next, over) = sum.overflowing_add(*more);
            *sum = next;
            overflow |= over;
        }
        for (sums, more) in self.colour.iter_mut().zip(&other.colour) {
            for (sum, more) in sums.iter_mut().zip(more) {
                let (next, over) = sum.overflowing_add(*more);
                *sum = next;
                overflow |= over;
            }
            overflow |= sums[3] > MAX_COLOURS;
        }
        overflow
    }

    /// Takes another block out, wrapping; returns whether it cannot have been in.
    pub(crate) fn subtract(&mut self, other: &Self) -> bool {
        let mut overflow = false;
        for voxel in 0..VOXELS {
            let (weight, under) = self.weight[voxel].overflowing_sub(other.weight[voxel]);
            let distance = self.distance[voxel].wrapping_sub(other.distance[voxel]);
            (self.weight[voxel], self.distance[voxel]) = (weight, distance);
            overflow |= under || i64::from(distance).abs() > i64::from(weight) * i64::from(ONE);
            for (sum, less) in self.colour[voxel].iter_mut().zip(&other.colour[voxel]) {
                let (next, under) = sum.overflowing_sub(*less);
                *sum = next;
                overflow |= under;
            }
        }
        overflow
    }

    /// The largest weight and the largest number of coloured observations: sums of blocks whose counts do not run over
    /// together do not run over.
    pub(crate) fn max_counts(&self) -> [u16; 2] {
        let weight = self.weight.iter().fold(0, |most, &w| most.max(w));
        [weight, self.colour.iter().fold(0, |most, c| most.max(c[3]))]
    }

    /// A linear form of all voxels modulo 2^64: the fingerprint of a sum of blocks is the sum of their fingerprints, so copies that
    /// need not be brought together. A change of a single voxel always changes it.
    pub(crate) fn fingerprint(&self) -> u64 {
        let mut fingerprint = 0_u64;
        for (voxel, factors) in FACTORS.iter().enumerate() {
            let [r, g, b, n] = self.colour[voxel].map(u64::from);
            let sums = i64::from(self.distance[voxel]).cast_unsigned();
            let sums = sums.wrapping_add(u64::from(self.weight[voxel]) << 32);
            let colour = r | g << 16 | b << 32 | n << 48;
            fingerprint =
                fingerprint.wrapping_add(sums.wrapping_mul(factors[0])).wrapping_add(colour.wrapping_mul(factors[1]));
        }
        fingerprint
    }
}

/// Odd, so that multiplication loses nothing.
const FACTORS: [[u64; 2]; VOXELS] = {
    let mut factors = [[0; 2]; VOXELS];
    let mut n = 0;
    while n < 2 * VOXELS {
        factors[n / 2][n % 2] = mix64(n as u64 + 1) | 1;
        n += 1;
    }
    factors
};

#[cfg(test)]
mod tests {
    use super::{MAX_COLOURS, ONE, VOXELS, VoxelBlock};

    #[test]
    fn the_sums_cannot_overflow_before_their_counters() {
        assert!(i64::from(ONE) * i64::from(u16::MAX) <= i64::from(i32::MAX));
        assert!(MAX_COLOURS.checked_mul(63).is_some());
        assert_eq!(size_of::<VoxelBlock>(), 14 * VOXELS);
    }
}
