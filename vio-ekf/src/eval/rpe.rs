//! Relative pose error: drift over frames or path lengths.

use nalgebra::Isometry3;

use super::stats::Stats;
use crate::error::Error;
use crate::lie::so3;
use crate::trajectory::{check_poses, path_lengths, same_length};

/// How far apart the two poses of a relative error are.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "lowercase"))]
pub enum Span {
    /// A number of poses, at least 1.
    Frames(usize),
    /// Metres along the path, more than 0.
    Metres(f64),
}

/// How exactly a [`Span::Metres`] must be met when all pairs are used.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "lowercase"))]
pub enum Tolerance {
    /// A share of the span.
    Relative(f64),
    /// Metres.
    Metres(f64),
}

/// Along which trajectory path lengths are measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "lowercase"))]
pub enum PairsFrom {
    /// The estimate, as `evo` does: a jittery estimate then shortens its own segments.
    Estimate,
    /// The reference: the same pairs for every estimate.
    Reference,
}

/// Which relative errors are taken. The defaults are those of `evo_rpe`.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct RpeSettings {
    /// Distance of the two poses; one frame.
    pub span: Span,
    /// From every pose on (overlapping), or each pair starting where the one before ended; off.
    pub all_pairs: bool,
    /// For metres with all pairs: the end, the pose nearest to the span, must meet it this well; 10 %.
    pub tolerance: Tolerance,
    /// Whose path is measured; the estimate's.
    pub pairs_from: PairsFrom,
}

impl Default for RpeSettings {
    fn default() -> Self {
        Self {
            span: Span::Frames(1),
            all_pairs: false,
            tolerance: Tolerance::Relative(0.1),
            pairs_from: PairsFrom::Estimate,
        }
    }
}

/// Relative pose error: how the motion between two poses differs, which is drift, free of any choice of frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Rpe {
    /// Of the translation errors, in metres.
    pub translation: Stats,
    /// Of the rotation errors, in radians.
    pub rotation: Stats,
    /// First and last index of each pair.
    pub pairs: Vec<(usize, usize)>,
    /// Length of the translation of `E` for each pair, in metres.
    pub translation_errors: Vec<f64>,
    /// Angle of the rotation of `E` for each pair, in radians.
    pub rotation_errors: Vec<f64>,
}

/// Relative errors `E = (G_i⁻¹ G_j)⁻¹ (E_i⁻¹ E_j)` of paired poses: `evo_rpe`.
///
/// A rigid alignment changes nothing; for a scale, pass poses moved by [`crate::eval::apply`].
pub fn rpe(reference: &[Isometry3<f64>], estimate: &[Isometry3<f64>], settings: &RpeSettings) -> Result<Rpe, Error> {
    same_length("reference", reference.len(), "estimate", estimate.len())?;
    check_poses("reference pose", reference)?;
    check_poses("estimated pose", estimate)?;
    let poses = match settings.pairs_from {
        PairsFrom::Estimate => estimate,
        PairsFrom::Reference => reference,
    };
    let pairs = match (settings.span, settings.all_pairs) {
        (Span::Frames(0), _) => {
            return Err(Error::InvalidSetting { name: "span", value: 0.0, rule: "must be at least one frame" });
        }
        (Span::Frames(n), true) => (0..poses.len().saturating_sub(n)).map(|i| (i, i + n)).collect(),
        (Span::Frames(n), false) => (0..poses.len().saturating_sub(n)).step_by(n).map(|i| (i, i + n)).collect(),
        (Span::Metres(metres), _) if !(metres > 0.0 && metres.is_finite()) => {
            return Err(Error::InvalidSetting { name: "span", value: metres, rule: "must be positive and finite" });
        }
        (Span::Metres(metres), true) => all_segments(&path_lengths(poses), metres, tolerance_m(settings, metres)?),
        (Span::Metres(metres), false) => consecutive_segments(poses, metres),
    };
    let errors: Vec<Isometry3<f64>> = pairs
        .iter()
        .map(|&(i, j)| {
            let (moved, estimated) = (reference[i].inv_mul(&reference[j]), estimate[i].inv_mul(&estimate[j]));
            moved.inv_mul(&estimated)
        })
        .collect();
    let translation_errors: Vec<f64> = errors.iter().map(|e| e.translation.vector.norm()).collect();
    let rotation_errors: Vec<f64> = errors.iter().map(|e| so3::log(&e.rotation).norm()).collect();
    let (Some(translation), Some(rotation)) = (Stats::of(&translation_errors), Stats::of(&rotation_errors)) else {
        let span = match settings.span {
            Span::Frames(n) => format!("{n} frames"),
            Span::Metres(metres) => format!("{metres} m"),
        };
        return Err(Error::NoPairs { span });
    };
    Ok(Rpe { translation, rotation, pairs, translation_errors, rotation_errors })
}

fn tolerance_m(settings: &RpeSettings, metres: f64) -> Result<f64, Error> {
    let (value, scale) = match settings.tolerance {
        Tolerance::Relative(share) => (share, metres),
        Tolerance::Metres(tolerance) => (tolerance, 1.0),
    };
    if value >= 0.0 && value.is_finite() {
        Ok(value * scale)
    } else {
        Err(Error::InvalidSetting { name: "tolerance", value, rule: "must be finite and not negative" })
    }
}

/// From every pose to the later one whose path is nearest to `metres`, the earliest if several are.
fn all_segments(lengths: &[f64], metres: f64, tolerance: f64) -> Vec<(usize, usize)> {
    let mut pairs = Vec::new();
    for start in 0..lengths.len().saturating_sub(1) {
        let later = &lengths[start + 1..];
        let first_at_least = |metres: f64| later.partition_point(|length| length - lengths[start] < metres);
        let miss = |offset: usize| (later[offset] - lengths[start] - metres).abs();
        let above = first_at_least(metres);
        // At standstill many poses share one path length: go back to the first of those below.
        let below = above.checked_sub(1).map(|offset| first_at_least(later[offset] - lengths[start]));
        let end = match below {
            Some(below) if above == later.len() || miss(below) <= miss(above) => below,
            _ => above,
        };
        if miss(end) <= tolerance {
            pairs.push((start, start + 1 + end));
        }
    }
    pairs
}

/// Pose to pose, each pair starting where the one before ended, as soon as the path has grown by `metres`.
fn consecutive_segments(poses: &[Isometry3<f64>], metres: f64) -> Vec<(usize, usize)> {
    let (mut pairs, mut start, mut length) = (Vec::new(), 0, 0.0);
    for (index, step) in poses.windows(2).enumerate() {
        length += (step[1].translation.vector - step[0].translation.vector).norm();
        if length >= metres {
            pairs.push((start, index + 1));
            (start, length) = (index + 1, 0.0);
        }
    }
    pairs
}
