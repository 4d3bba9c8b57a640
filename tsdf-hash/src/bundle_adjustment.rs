//! Dense bundle adjustment: the poses of all keyframes at once, from the surface that they see in common.

pub(crate) mod adjust;
mod pixel_cell;
mod point_terms;
mod posed_frame;
mod residual_stats;
pub(crate) mod settings;
mod surface_points;
