//! The figures of a tuning.

use serde::Serialize;

/// What `report.json` of a tuning holds.
#[derive(Debug, Clone, Serialize)]
pub struct TuningReport {
    /// Version of the program.
    pub version: &'static str,
    /// Recordings.
    pub recordings: usize,
    /// Points that the search asked for.
    pub evaluations: usize,
    /// Points whose cost was computed in this run, random ones left out.
    pub evaluations_computed: usize,
    /// Geometric mean of the position errors, each weighted by the inconsistency of its covariance: at the start of the search.
    pub weighted_error_start_m: f64,
    /// The same at its end.
    pub weighted_error_best_m: f64,
    /// Geometric mean of the position errors at the start.
    pub ate_start_m: f64,
    /// The same at the end.
    pub ate_best_m: f64,
    /// Mean normalised squared error of position, attitude and velocity at the start; 3 is consistent.
    pub nees_start: f64,
    /// The same at the end.
    pub nees_best: f64,
    /// Factor on the gyroscope's white noise.
    pub factor_gyro_white: f64,
    /// Factor on its walk.
    pub factor_gyro_walk: f64,
    /// Factor on the accelerometer's white noise.
    pub factor_accel_white: f64,
    /// Factor on its walk.
    pub factor_accel_walk: f64,
    /// Factor on the noise in images.
    pub factor_image: f64,
    /// Weighted error of recordings that were left out, each judged with the noise of the data sheet; absent with one recording.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub held_out_error_data_sheet_m: Option<f64>,
    /// The same with the noise that is best for the others.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub held_out_error_tuned_m: Option<f64>,
    /// Position error of them, geometric mean, with the noise of the data sheet.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub held_out_ate_data_sheet_m: Option<f64>,
    /// The same with the noise that is best for the others.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub held_out_ate_tuned_m: Option<f64>,
    /// Whether the data sheet is handed on because the search does not help on what it has not seen, or makes positions worse there.
    pub data_sheet_kept: bool,
    /// Points drawn at random.
    pub random_samples: usize,
    /// Weighted error of the best of them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub weighted_error_random_m: Option<f64>,
    /// Weighted error of the search over that of the best random point.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ratio_to_random: Option<f64>,
    /// Wall-clock time of the search.
    pub search_wall_s: f64,
    /// Worker threads.
    pub threads: usize,
}
