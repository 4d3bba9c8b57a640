//! Seeded random numbers: the same seed gives the same bytes on every build.

use nalgebra::Vector3;
use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng as _, SeedableRng as _};

/// `SplitMix64` (Steele, Lea and Flood 2014) with normal deviates by the polar method (Marsaglia and Bray 1964).
#[derive(Debug, Clone)]
pub(crate) struct Rng {
    bits: SplitMix64,
    spare: Option<f64>,
}

impl Rng {
    /// A stream for each pair of seed and `stream`: noise sources do not disturb one another when one is switched off.
    pub(crate) fn new(seed: u64, stream: u64) -> Self {
        let mut mixed = SplitMix64::seed_from_u64(seed ^ stream.wrapping_mul(0xA24B_AED4_963E_E407));
        Self { bits: SplitMix64::seed_from_u64(mixed.next_u64()), spare: None }
    }

    /// Uniform in `[0, 1)` with 53 bits.
    pub(crate) fn uniform(&mut self) -> f64 {
        (self.bits.next_u64() >> 11) as f64 * (1.0 / 9_007_199_254_740_992.0)
    }

    /// Three normal deviates.
    pub(crate) fn normal3(&mut self) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.normal())
    }

    /// Normal deviate with mean 0 and variance 1.
    pub(crate) fn normal(&mut self) -> f64 {
        if let Some(value) = self.spare.take() {
            return value;
        }
        loop {
            let (x, y) = (2.0 * self.uniform() - 1.0, 2.0 * self.uniform() - 1.0);
            let s = x * x + y * y;
            if s > 0.0 && s < 1.0 {
                let scale = (-2.0 * s.ln() / s).sqrt();
                self.spare = Some(y * scale);
                return x * scale;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_stream_is_the_published_one() {
        // The first three outputs of SplitMix64 for the seed 1234567, as its authors' C code prints them.
        let mut bits = SplitMix64::seed_from_u64(1_234_567);
        for expected in [6_457_827_717_110_365_317_u64, 3_203_168_211_198_807_973, 9_817_491_932_198_370_423] {
            assert_eq!(bits.next_u64(), expected);
        }
        // Seed and stream are both mixed in, and 53 bits make a uniform number.
        let mut twice = SplitMix64::seed_from_u64(5 ^ 3_u64.wrapping_mul(0xA24B_AED4_963E_E407));
        let mut once = SplitMix64::seed_from_u64(twice.next_u64());
        assert_eq!(Rng::new(5, 3).uniform(), (once.next_u64() >> 11) as f64 / 2.0_f64.powi(53));
        assert_ne!(Rng::new(5, 3).uniform(), Rng::new(5, 4).uniform());
        assert_ne!(Rng::new(5, 3).uniform(), Rng::new(6, 3).uniform());
    }
}
