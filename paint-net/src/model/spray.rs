//! One spray of the nozzle.

/// One spray: the nozzle over a point for long enough to add a depth there.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Spray {
    /// Column, pixels.
    pub x: f64,
    /// Row, pixels.
    pub y: f64,
    /// Depth added at the centre, in the unit of the saturation curve.
    pub volume: f64,
    /// Standard deviation, pixels: the kernel's, unless a painter may open the cone.
    pub sigma: f64,
}
