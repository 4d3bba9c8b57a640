//! A depth frame into voxel blocks: planes per pixel, the blocks near them, the update of a block.

pub(crate) mod block_bounds;
pub(crate) mod block_selection;
pub(crate) mod colour;
pub(crate) mod gap_filling;
pub(crate) mod integrator;
pub(crate) mod inverse_depth_noise;
pub(crate) mod partial_window;
pub(crate) mod plane;
pub(crate) mod plane_image;
pub(crate) mod plane_tile;
pub(crate) mod plane_windows;
pub(crate) mod rims;
#[cfg(test)]
mod tests;
pub(crate) mod voxel_lanes;
