//! What the benches share: scenes of the size of the built-in world, seeded and built in memory, and criterion's settings.

pub mod calibration;
pub mod colours;
pub mod control;
pub mod cpu;
pub mod droplet_rays;
pub mod films;
pub mod flight;
pub mod frames;
pub mod fuzzed_meshes;
pub mod motion;
pub mod npy;
pub mod painting;
pub mod planned_stroke;
pub mod planner;
pub mod pose_graphs;
pub mod results;
pub mod rock;
pub mod room;
pub mod sequences;
pub mod slam_sequences;
pub mod split_meshes;
pub mod state_programs;
pub mod vocabulary;

use std::time::Duration;

use criterion::Criterion;
use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng as _, SeedableRng as _};

/// Few samples over a short time, so that all benches together take minutes; the command line overrides them.
pub fn criterion() -> Criterion {
    Criterion::default()
        .sample_size(10)
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_millis(1500))
        .configure_from_args()
}

/// All the randomness of the scenes: splitmix64.
#[derive(Debug, Clone)]
pub struct Rng(SplitMix64);

impl Rng {
    /// Starts from a seed.
    pub fn new(seed: u64) -> Self {
        Self(SplitMix64::seed_from_u64(seed))
    }

    /// A number in `[0, 1)`.
    pub fn unit(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// A number between `low` and `high`.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// A number of the standard normal distribution (Box and Muller 1958).
    pub fn normal(&mut self) -> f64 {
        let (u, v) = (self.unit(), self.unit());
        (-2.0 * (1.0 - u).ln()).sqrt() * (std::f64::consts::TAU * v).cos()
    }
}
