//! Absolute trajectory error.

use nalgebra::{Isometry3, Similarity3};

use super::align::{Alignment, align, apply};
use super::stats::Stats;
use crate::error::Error;
use crate::lie::so3;
use crate::trajectory::{check_poses, same_length};

/// Absolute trajectory error: what is left of the difference of poses after alignment.
#[derive(Debug, Clone, PartialEq)]
pub struct Ate {
    /// The alignment that was applied to the estimate.
    pub reference_from_estimate: Similarity3<f64>,
    /// Of the position errors, in metres.
    pub position: Stats,
    /// Of the orientation errors, in radians.
    pub orientation: Stats,
    /// `|g − (s R e + t)|` for each pair, in metres.
    pub position_errors: Vec<f64>,
    /// Angle between the orientations for each pair, in radians, `[0, π]`.
    pub orientation_errors: Vec<f64>,
}

/// Absolute trajectory error of paired poses: `evo_ape`, with [`Alignment::PosYaw`] in addition.
///
/// `reference[i]` and `estimate[i]` belong together; see [`crate::eval::Association::pair_up`].
pub fn ate(reference: &[Isometry3<f64>], estimate: &[Isometry3<f64>], mode: Alignment) -> Result<Ate, Error> {
    same_length("reference", reference.len(), "estimate", estimate.len())?;
    check_poses("reference pose", reference)?;
    check_poses("estimated pose", estimate)?;
    let reference_from_estimate = align(reference, estimate, mode)?;
    let aligned = apply(&reference_from_estimate, estimate);
    let pairs = || reference.iter().zip(&aligned);
    let position_errors: Vec<f64> =
        pairs().map(|(g, e)| (g.translation.vector - e.translation.vector).norm()).collect();
    let orientation_errors: Vec<f64> = pairs().map(|(g, e)| so3::angle_between(&e.rotation, &g.rotation)).collect();
    let none = Error::TooFew { what: "pose pairs to compare", got: 0, need: 1 };
    let (Some(position), Some(orientation)) = (Stats::of(&position_errors), Stats::of(&orientation_errors)) else {
        return Err(none);
    };
    Ok(Ate { reference_from_estimate, position, orientation, position_errors, orientation_errors })
}
