//! Neighbouring voxels of a row, projected side by side.

use nalgebra::Vector3;

use crate::blocks::voxel_block::SIDE;

/// Neighbours along x that are updated together, a row of a block: the widest vector register.
pub(crate) const LANES: usize = SIDE;

/// All ones, or zero.
#[inline(always)]
pub(crate) fn mask(condition: bool) -> i32 {
    -i32::from(condition)
}

/// Projected voxels.
pub(crate) struct ProjectedVoxels {
    /// All ones in the image, zero outside.
    pub(crate) inside: [i32; LANES],
    /// Of the pixel; 0 outside the image.
    pub(crate) index: [i32; LANES],
    pub(crate) depth: [f32; LANES],
    /// The projection, pixels.
    pub(crate) u: [f32; LANES],
    pub(crate) v: [f32; LANES],
    /// From the pixel's centre to the projection.
    pub(crate) du: [f32; LANES],
    pub(crate) dv: [f32; LANES],
}

/// From the first voxel of a row to each: the change of `(u z, v z, z)`.
pub(crate) struct RowOffsets {
    pub(crate) u: [f32; LANES],
    pub(crate) v: [f32; LANES],
    pub(crate) depth: [f32; LANES],
}

impl RowOffsets {
    pub(crate) fn new(step: &Vector3<f32>) -> Self {
        let along: [f32; LANES] = std::array::from_fn(|x| x as f32);
        Self { u: along.map(|x| step.x * x), v: along.map(|x| step.y * x), depth: along.map(|x| step.z * x) }
    }
}
