//! Two trajectories side by side.

use std::fmt::Write as _;
use std::path::Path;

use serde::Serialize;
use vio_ekf::{Alignment, Error, Evaluation, EvaluationSettings};

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
    /// For each length of path, m: median translation error, m, and rotation error, rad.
    #[serde(skip)]
    pub drift: Vec<(f64, Option<[f64; 2]>)>,
}

/// Compares two files of poses, TUM or EuRoC text.
///
/// # Errors
/// [`VioError`] names the file that cannot be read, or says that the times do not meet.
pub fn compare(reference: &Path, estimate: &Path) -> Result<Comparison, VioError> {
    let (reference, estimate) = (read_truth(reference)?.trajectory, read_truth(estimate)?.trajectory);
    let evaluate = |alignment| {
        let settings = EvaluationSettings { alignment, ..EvaluationSettings::default() };
        match vio_ekf::evaluate(&reference, &estimate, &settings) {
            // All poses at one place, or on one line.
            Err(Error::Degenerate { .. }) => Ok(None),
            other => other.map(Some),
        }
    };
    // Pairs and drift do not depend on the alignment; without any it is always defined.
    let raw = vio_ekf::evaluate(
        &reference,
        &estimate,
        &EvaluationSettings { alignment: Alignment::None, ..EvaluationSettings::default() },
    )?;
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
        drift: raw
            .segments
            .iter()
            .map(|s| (s.length_m, s.rpe.as_ref().map(|rpe| [rpe.translation.median, rpe.rotation.median])))
            .collect(),
    })
}

impl Comparison {
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
        for (length, errors) in &self.drift {
            row(&format!("error over {length} m of path, median"), errors.map(|e| e[0]), errors.map(|e| e[1]));
        }
        let _ = writeln!(
            text,
            "\n{} pairs of poses over {:.1} % of the reference; the longest gap is {:.2} s.",
            self.pairs,
            100.0 * self.coverage,
            self.longest_gap_s
        );
        text
    }
}
