//! What was commanded and what was measured.

/// One line of a recording.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AttitudeSample {
    /// Time, s.
    pub time: f64,
    /// Angle commanded from here until the next sample, rad.
    pub commanded: f64,
    /// Angle measured here, rad.
    pub measured: f64,
}
