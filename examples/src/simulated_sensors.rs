//! What a simulated robot senses of the surface before it, and what goes wrong with its sensors.

mod camera;
mod fault;

pub use camera::{FRAMES_PER_SECOND, RgbdViews, SimulatedCamera, SimulatedImage};
pub use fault::{FaultInterval, SensorFault};
