//! What the benches share: scenes of the size of the built-in world, seeded and built in memory, and criterion's settings.

pub mod colours;
pub mod cpu;
pub mod films;
pub mod flight;
pub mod frames;
pub mod motion;
pub mod painting;
pub mod rock;
pub mod room;
pub mod sequences;

use std::time::Duration;

use criterion::Criterion;

/// Few samples over a short time, so that all benches together take minutes; the command line overrides them.
pub fn criterion() -> Criterion {
    Criterion::default()
        .sample_size(10)
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_millis(1500))
        .configure_from_args()
}

/// splitmix64 (Steele, Lea, Flood 2014): all the randomness of the scenes.
#[derive(Debug, Clone)]
pub struct Rng(pub u64);

impl Rng {
    /// A number in `[0, 1)`.
    pub fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// A number between `low` and `high`.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }
}
