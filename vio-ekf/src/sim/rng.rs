//! The simulator's randomness: a seed, or a seed and a counter, always give the same numbers.

use nalgebra::Vector3;
use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng as _, SeedableRng as _};

const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

/// Mixes the bits of a counter: the output function of splitmix64 (Steele, Lea, Flood 2014). The generator adds its step
/// before it mixes.
pub(super) fn mix(z: u64) -> u64 {
    SplitMix64::seed_from_u64(z.wrapping_sub(GOLDEN)).next_u64()
}

/// A seed for one part of what a seed makes, so that parts do not depend on the order in which they are made.
pub(super) fn derive(seed: u64, part: u64) -> u64 {
    mix(mix(seed.wrapping_add(GOLDEN)) ^ part.wrapping_mul(GOLDEN).wrapping_add(part))
}

/// splitmix64, and the distributions that the simulator draws from.
#[derive(Debug, Clone)]
pub(crate) struct Rng(SplitMix64);

impl Rng {
    pub(crate) fn new(seed: u64) -> Self {
        Self(SplitMix64::seed_from_u64(seed))
    }

    pub(super) fn bits(&mut self) -> u64 {
        self.0.next_u64()
    }

    /// In `[0, 1)`.
    pub(crate) fn uniform(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform()
    }

    /// Integer in `0..n`.
    pub(super) fn below(&mut self, n: usize) -> usize {
        ((u128::from(self.bits()) * n as u128) >> 64) as usize
    }

    /// Standard normal (Box and Muller 1958).
    pub(crate) fn normal(&mut self) -> f64 {
        // One minus a number below one is never zero.
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform()).cos()
    }

    pub(crate) fn normal_vector(&mut self) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.normal())
    }
}

#[cfg(test)]
mod tests {
    use super::{Rng, mix};

    /// Recordings and committed figures stand on this stream: the values of the reference implementation for this seed.
    #[test]
    fn the_stream_is_splitmix64() {
        let mut rng = Rng::new(1234567);
        let first: [u64; 4] = std::array::from_fn(|_| rng.bits());
        assert_eq!(first, [6457827717110365317, 3203168211198807973, 9817491932198370423, 4593380528125082431]);
        assert_eq!(mix(1234567_u64.wrapping_add(0x9e37_79b9_7f4a_7c15)), first[0]);
    }
}
