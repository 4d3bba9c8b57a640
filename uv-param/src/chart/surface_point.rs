//! A point of the surface.

use nalgebra::Vector3;

/// A point of the surface: a face of the disk and the weights of its corners (non-negative, sum 1).
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct SurfacePoint {
    /// Face of the [`Disk`](crate::Disk).
    pub face: u32,
    /// Weights of corners 0, 1, 2.
    pub barycentric: [f64; 3],
}

impl SurfacePoint {
    /// What lies here of a vector that is given at the corners. Written out: a sum over an iterator was seen to be a loop.
    #[inline]
    pub(crate) fn interpolate(&self, corners: [Vector3<f64>; 3]) -> Vector3<f64> {
        let [a, b, c] = self.barycentric;
        a * corners[0] + b * corners[1] + c * corners[2]
    }
}
