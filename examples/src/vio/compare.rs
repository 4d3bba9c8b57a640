//! Two trajectories side by side.

use std::fmt::Write as _;
use std::path::Path;

use serde::Serialize;
use vio_ekf::Error;
use vio_ekf::eval::{Alignment, Association, Evaluation, EvaluationSettings};

use super::error::VioError;
use super::euroc_folder::read_truth;

/// What `vio eval` finds. Flat, SI units in the names; what cannot be determined is absent.
#[derive(Debug, Clone, Serialize)]
pub struct Comparison {
    /// Pairs of poses.
    pub pairs: usize,
    /// Share of the reference's duration that is covered.
    pub coverage: f64,
    /// Longest time between two pairs.
    pub longest_gap_s: f64,
    /// Root mean square position error after rigid alignment.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ate_se3_rmse_m: Option<f64>,
    /// The same, attitude.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ate_se3_rotation_rmse_rad: Option<f64>,
    /// Root mean square position error after alignment of position and yaw.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ate_yaw_rmse_m: Option<f64>,
    /// The same, attitude.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ate_yaw_rotation_rmse_rad: Option<f64>,
    /// Root mean square position error after alignment of the scale as well.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ate_sim3_rmse_m: Option<f64>,
    /// Factor that brings the estimate to the size of the reference.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scale: Option<f64>,
    /// Lengths of path over which the relative error was taken, those that the reference has.
    pub rpe_length_m: Vec<f64>,
    /// Median translation error over each of these lengths.
    pub rpe_translation_median_m: Vec<f64>,
    /// Median rotation error over each of these lengths.
    pub rpe_rotation_median_rad: Vec<f64>,
    /// Lengths that the reference does not have.
    #[serde(skip)]
    pub too_long_m: Vec<f64>,
    /// Whether the table shows the error after alignment of the scale.
    #[serde(skip)]
    pub sim3: bool,
}

/// How two files are compared.
#[derive(Debug, Clone, PartialEq)]
pub struct CompareSettings {
    /// Largest time difference of a pair of poses.
    pub max_difference_s: f64,
    /// Whether the error after alignment of the scale is shown.
    pub sim3: bool,
    /// Lengths of path over which the relative error is taken.
    pub rpe_lengths_m: Vec<f64>,
}

/// The scale is what is wrong if it is off by this share...
const WRONG_SCALE: f64 = 0.02;
/// ... and the error with it aligned is smaller by this factor.
const BY_SCALE_ALONE: f64 = 0.3;

/// Compares two files of poses, TUM or EuRoC text.
///
/// # Errors
/// [`VioError`] names the file that cannot be read, or says that the times do not meet.
pub fn compare(reference: &Path, estimate: &Path, settings: &CompareSettings) -> Result<Comparison, VioError> {
    let (reference, estimate) = (read_truth(reference)?.trajectory, read_truth(estimate)?.trajectory);
    let with = |alignment| EvaluationSettings {
        alignment,
        association: Association { max_difference_s: settings.max_difference_s, ..Association::default() },
        segment_lengths_m: settings.rpe_lengths_m.clone(),
        ..EvaluationSettings::default()
    };
    let evaluate = |alignment| {
        match vio_ekf::eval::evaluate(&reference, &estimate, &with(alignment)) {
            // All poses at one place, or on one line.
            Err(Error::Degenerate { .. }) => Ok(None),
            other => other.map(Some),
        }
    };
    // Pairs and drift do not depend on the alignment; without any it is always defined.
    let raw = vio_ekf::eval::evaluate(&reference, &estimate, &with(Alignment::None))?;
    let scaled = evaluate(Alignment::Sim3)?;
    let measured = raw.segments.iter().filter_map(|segment| Some((segment.length_m, segment.rpe.as_ref()?)));
    let (rigid, yaw) = (evaluate(Alignment::Se3)?, evaluate(Alignment::PosYaw)?);
    let position = |e: &Option<Evaluation>| e.as_ref().map(|e| e.ate.position.rmse);
    let rotation = |e: &Option<Evaluation>| e.as_ref().map(|e| e.ate.orientation.rmse);
    Ok(Comparison {
        pairs: raw.pairs,
        coverage: raw.coverage,
        longest_gap_s: raw.longest_gap_s,
        ate_se3_rmse_m: position(&rigid),
        ate_se3_rotation_rmse_rad: rotation(&rigid),
        ate_yaw_rmse_m: position(&yaw),
        ate_yaw_rotation_rmse_rad: rotation(&yaw),
        ate_sim3_rmse_m: position(&scaled),
        scale: scaled.as_ref().map(|scaled| scaled.ate.reference_from_estimate.scaling()),
        rpe_length_m: measured.clone().map(|(length, _)| length).collect(),
        rpe_translation_median_m: measured.clone().map(|(_, rpe)| rpe.translation.median).collect(),
        rpe_rotation_median_rad: measured.map(|(_, rpe)| rpe.rotation.median).collect(),
        too_long_m: raw.segments.iter().filter(|segment| segment.rpe.is_none()).map(|s| s.length_m).collect(),
        sim3: settings.sim3,
    })
}

impl Comparison {
    /// The scale, and the errors with and without it, if it is most of the difference.
    fn differs_by_scale(&self) -> Option<(f64, [f64; 2])> {
        let (scale, with, without) = (self.scale?, self.ate_sim3_rmse_m?, self.ate_se3_rmse_m?);
        ((scale - 1.0).abs() > WRONG_SCALE && with < BY_SCALE_ALONE * without).then_some((scale, [with, without]))
    }

    /// The figures as a Markdown table.
    pub fn table(&self) -> String {
        let mut text = String::from("| figure | position | attitude |\n|---|---|---|\n");
        let mut row = |name: &str, metres: Option<f64>, radians: Option<f64>| {
            let show = |value: Option<f64>, unit: &str| value.map_or("-".into(), |v| format!("{v:.6} {unit}"));
            let _ =
                writeln!(text, "| {name} | {} | {} |", show(metres, "m"), show(radians.map(f64::to_degrees), "deg"));
        };
        row("absolute error, rigid alignment, RMS", self.ate_se3_rmse_m, self.ate_se3_rotation_rmse_rad);
        row("absolute error, position and yaw aligned, RMS", self.ate_yaw_rmse_m, self.ate_yaw_rotation_rmse_rad);
        if self.sim3 {
            row("absolute error, position, attitude and scale aligned, RMS", self.ate_sim3_rmse_m, None);
        }
        let drift = self.rpe_translation_median_m.iter().zip(&self.rpe_rotation_median_rad);
        for (length, (metres, radians)) in self.rpe_length_m.iter().zip(drift) {
            row(&format!("error over {length} m of path, median"), Some(*metres), Some(*radians));
        }
        for length in &self.too_long_m {
            row(&format!("error over {length} m of path, median"), None, None);
        }
        let _ = writeln!(
            text,
            "\n{} pairs of poses over {:.1} % of the reference; the longest gap is {:.2} s.",
            self.pairs,
            100.0 * self.coverage,
            self.longest_gap_s
        );
        if let Some(scale) = self.scale.filter(|_| self.sim3) {
            let _ = writeln!(text, "The reference is {scale:.4} times as large as the estimate.");
        }
        if let Some((scale, [with, without])) = self.differs_by_scale() {
            let _ = writeln!(
                text,
                "\nThey differ by scale: the reference is {scale:.3} times as large as the estimate, and with the scale aligned the \
                 error is {with:.4} m instead of {without:.4} m."
            );
        }
        text
    }
}
