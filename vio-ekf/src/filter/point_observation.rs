//! What a point tracker of the caller's own gives.

use nalgebra::Vector2;

/// A landmark seen by a tracker of the caller's own.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointObservation {
    /// The same for the same landmark in all images.
    pub id: u64,
    /// Where it is, pixels.
    pub pixel: Vector2<f64>,
}

/// A landmark seen by a tracker of the caller's own, maybe in the images of both cameras.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointPair {
    /// What the first camera sees.
    pub first: PointObservation,
    /// Where it is in the image that the second camera took at the same moment, pixels; none if it is not seen there.
    pub second: Option<Vector2<f64>>,
}
