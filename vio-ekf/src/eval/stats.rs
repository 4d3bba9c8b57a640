//! Figures of a list of errors.

/// Summary of a list of errors.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Stats {
    /// Number of errors.
    pub count: usize,
    /// Root of the mean square.
    pub rmse: f64,
    /// Mean.
    pub mean: f64,
    /// Median; the mean of the two middle ones for an even number.
    pub median: f64,
    /// Standard deviation about the mean, divided by `count`.
    pub std: f64,
    /// Smallest.
    pub min: f64,
    /// Largest.
    pub max: f64,
}

impl Stats {
    /// Of finite values; `None` if there are none, or one is not finite.
    pub fn of(values: &[f64]) -> Option<Self> {
        if values.is_empty() || values.iter().any(|v| !v.is_finite()) {
            return None;
        }
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        let count = sorted.len();
        let n = count as f64;
        let mean = sorted.iter().sum::<f64>() / n;
        Some(Self {
            count,
            rmse: (sorted.iter().map(|v| v * v).sum::<f64>() / n).sqrt(),
            mean,
            median: f64::midpoint(sorted[(count - 1) / 2], sorted[count / 2]),
            std: (sorted.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt(),
            min: sorted[0],
            max: sorted[count - 1],
        })
    }
}
