//! Propagation of state and covariance between images.

pub(crate) mod camera_motion;
pub(crate) mod propagate;
mod second_order_terms;
#[cfg(test)]
mod tests;
