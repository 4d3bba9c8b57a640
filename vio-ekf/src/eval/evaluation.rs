//! One trajectory against another in one call.

use crate::error::Error;
use crate::eval::align::{Alignment, apply};
use crate::eval::associate::Association;
use crate::eval::ate::{Ate, ate};
use crate::eval::rpe::{PairsFrom, Rpe, RpeSettings, Span, Tolerance, rpe};
use crate::trajectory::Trajectory;

/// How [`evaluate`] compares.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct EvaluationSettings {
    /// Which poses belong together.
    pub association: Association,
    /// What is removed before absolute errors are taken. Position and yaw by default: what an estimator with gravity
    /// and scale cannot know.
    pub alignment: Alignment,
    /// Path lengths in metres over which drift is measured; 8, 16, 24, 32, 40 as published with OpenVINS.
    pub segment_lengths_m: Vec<f64>,
    /// A segment's end may be this far, in metres, from the wanted length; 0.5 as published with OpenVINS.
    pub segment_tolerance_m: f64,
}

impl Default for EvaluationSettings {
    fn default() -> Self {
        Self {
            association: Association::default(),
            alignment: Alignment::PosYaw,
            segment_lengths_m: vec![8.0, 16.0, 24.0, 32.0, 40.0],
            segment_tolerance_m: 0.5,
        }
    }
}

/// Drift over one path length.
#[derive(Debug, Clone, PartialEq)]
pub struct Segment {
    /// The length asked for, in metres.
    pub length_m: f64,
    /// Relative errors over all segments of this length, `None` if the reference holds no such segment.
    pub rpe: Option<Rpe>,
}

/// What [`evaluate`] found.
#[derive(Debug, Clone, PartialEq)]
pub struct Evaluation {
    /// Number of pose pairs compared.
    pub pairs: usize,
    /// Share of the reference's duration between the first and the last pair, 0 to 1. A good error over half of the
    /// recording is not a good result; gaps inside show in `longest_gap_s`.
    pub coverage: f64,
    /// Longest time between consecutive pairs, in seconds.
    pub longest_gap_s: f64,
    /// Absolute errors after alignment.
    pub ate: Ate,
    /// Relative errors, one entry per length of the settings; pairs are chosen along the reference.
    pub segments: Vec<Segment>,
}

/// Pairs up, aligns and measures in one call.
///
/// Quote the alignment with the figures: the same run can be excellent in one mode and poor in another.
pub fn evaluate(
    reference: &Trajectory,
    estimate: &Trajectory,
    settings: &EvaluationSettings,
) -> Result<Evaluation, Error> {
    let pairs = settings.association.pair_up(reference, estimate)?;
    let ate = ate(&pairs.reference, &pairs.estimate, settings.alignment)?;
    let aligned = apply(&ate.reference_from_estimate, &pairs.estimate);
    let segments = settings.segment_lengths_m.iter().map(|&length_m| {
        let rpe_settings = RpeSettings {
            span: Span::Metres(length_m),
            all_pairs: true,
            tolerance: Tolerance::Metres(settings.segment_tolerance_m),
            pairs_from: PairsFrom::Reference,
        };
        let rpe = match rpe(&pairs.reference, &aligned, &rpe_settings) {
            Ok(rpe) => Some(rpe),
            Err(Error::NoPairs { .. }) => None,
            Err(error) => return Err(error),
        };
        Ok(Segment { length_m, rpe })
    });
    let segments = segments.collect::<Result<_, _>>()?;

    let covered = pairs.stamps.last().zip(pairs.stamps.first()).map_or(0.0, |(last, first)| last.secs_since(*first));
    let duration = reference.duration_s();
    Ok(Evaluation {
        pairs: pairs.stamps.len(),
        coverage: if duration > 0.0 { (covered / duration).min(1.0) } else { 1.0 },
        longest_gap_s: pairs.stamps.windows(2).map(|w| w[1].secs_since(w[0])).fold(0.0, f64::max),
        ate,
        segments,
    })
}
