//! A set of faces laid out in the plane within the bounds of distortion, or repaired until it is.

pub(in crate::atlas) mod add_region;
pub(in crate::atlas) mod fit;
pub(in crate::atlas) mod procrustes;
pub(in crate::atlas) mod refine;
pub(in crate::atlas) mod simple_boundary;
pub(in crate::atlas) mod untangle;
