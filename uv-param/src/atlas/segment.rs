//! First charts: regions of similar normals, sides between creases, and charts of a coarse surface carried over to the fine one.

pub(in crate::atlas) mod creases;
pub(in crate::atlas) mod shape_approximation;
pub(in crate::atlas) mod transfer;
