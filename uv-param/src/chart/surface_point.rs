//! A point of the surface.

/// A point of the surface: a face of the disk and the weights of its corners (non-negative, sum 1).
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct SurfacePoint {
    /// Face of the [`Disk`](crate::Disk).
    pub face: u32,
    /// Weights of corners 0, 1, 2.
    pub barycentric: [f64; 3],
}
