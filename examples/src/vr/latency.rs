//! Latencies over a session's time, as Fig. 6 of the VR paper plots them.

/// Latencies over the session's time.
#[derive(Debug, Clone, Default)]
pub struct LatencyCurves {
    /// Time and latency in distance, s and m, while the person paints or the robot lags.
    pub distance: Vec<(f64, f64)>,
    /// Time and latency in time at each plan, s.
    pub time: Vec<(f64, f64)>,
    /// Time that planning took, s of wall clock.
    pub planning: Vec<f64>,
}
