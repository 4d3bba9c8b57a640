//! What a simulated robot senses: images and depth of the surface before it, and its own motion.

mod camera;
mod fault;
mod inertial;

pub use camera::{FRAMES_PER_SECOND, SimulatedCamera, SimulatedImage};
pub use fault::{FaultInterval, SensorFault};
pub use inertial::SimulatedImu;

use paint_net::procedural::lattice;

/// A number of the standard normal distribution, the same for the same arguments.
fn normal(seed: u64, stream: i64, index: i64) -> f64 {
    let uniform = |half: i64| lattice(seed, stream, 2 * index + half);
    (-2.0 * (1.0 - uniform(0)).ln()).sqrt() * (std::f64::consts::TAU * uniform(1)).cos()
}
