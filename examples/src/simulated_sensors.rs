//! What a simulated robot senses of the surface before it, and what goes wrong with its sensors.

mod camera;
mod fault;
mod painted_front;

pub use camera::{FRAMES_PER_SECOND, HALF_VIEW, RgbdViews, SimulatedCamera, SimulatedImage};
pub use fault::{FaultInterval, SensorFault};
pub use painted_front::{PaintedFront, SEEN, SHOT_STEP};
