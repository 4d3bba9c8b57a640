//! Initialization in motion: state and scale from some images and the inertial samples between them.

mod closed_form;
mod gyro_bias;
mod refinement;
pub(crate) mod result;
pub(crate) mod solver;
#[cfg(test)]
mod tests;
pub(crate) mod window;
