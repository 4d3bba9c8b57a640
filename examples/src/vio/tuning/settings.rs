//! What a search for noise settings can be told.

use vio_ekf::tune::{NoisePoint, TuneSettings};

/// Names of the five groups, in the order of a [`NoisePoint`].
pub(super) const GROUPS: [&str; 5] =
    ["gyroscope, white", "gyroscope, walk", "accelerometer, white", "accelerometer, walk", "image"];

/// A tuning.
#[derive(Debug, Clone, Copy)]
pub struct Tuning {
    /// The search.
    pub search: TuneSettings,
    /// Powers of ten on the noise that is given, from which the search starts.
    pub start: NoisePoint,
    /// Weight of inconsistent covariances (NEES off 3) beside position errors.
    pub consistency_weight: f64,
    /// Cost of a squared power of ten away from the data sheet.
    pub regularization: f64,
    /// Points drawn at random inside the same bounds, to compare with.
    pub random: usize,
    /// Seed of these.
    pub seed: u64,
    /// Whether to go on from `trials.csv` in the folder.
    pub resume: bool,
    /// Recordings that are run at once.
    pub threads: usize,
}
