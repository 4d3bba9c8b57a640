//! Detection of a stationary body, and its propagation without motion.

pub(crate) mod block_noise;
pub(crate) mod detector;
pub(crate) mod parallax_check;
pub(crate) mod zero_velocity;
