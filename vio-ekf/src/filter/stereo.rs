//! Depth from a second camera.

mod calibrating;
pub(crate) mod epipolar_search;
pub(crate) mod rig;
pub(crate) mod stereo_camera;
pub(crate) mod stereo_points;
#[cfg(test)]
mod tests;
