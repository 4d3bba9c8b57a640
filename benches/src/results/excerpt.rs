//! The part of two flights that a figure shows.

use paint_sim::flight::{FlightLog, FlightSample};

/// As long as that of the papers' figures, s.
const SHOWN: [f64; 2] = [10.0, 40.0];
/// Samples of a log between two points of a curve.
const STRIDE: usize = 10;

/// Samples of both flights at the same times.
pub(super) fn excerpt<'a>(
    a: &'a FlightLog,
    b: &'a FlightLog,
) -> impl Iterator<Item = (&'a FlightSample, &'a FlightSample)> {
    let pairs = a.samples.iter().zip(&b.samples).step_by(STRIDE);
    pairs.filter(|(sample, _)| (SHOWN[0]..SHOWN[1]).contains(&sample.time))
}
