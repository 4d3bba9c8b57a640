//! What a layout of a disk in the plane has to offer.

pub(crate) mod arap;
pub(crate) mod symmetric_dirichlet;
pub(crate) mod tutte;

use crate::disk::Disk;
use crate::error::Error;
pub use arap::Arap;
pub use symmetric_dirichlet::SymmetricDirichlet;
pub use tutte::Tutte;

/// Lays a disk out in the plane: a map from the surface to uv, one point per vertex.
///
/// [`Tutte`], [`Arap`] and [`SymmetricDirichlet`] are
/// implementations; a closed form of one's own (a cylinder, a cone) is another, see
/// [`unwrap_by`](crate::unwrap_by).
pub trait Parametrizer {
    /// The layout of `disk` in the scale of the surface (metres). It need not be turned or shifted: the chart does that.
    /// `progress` is called once per iteration.
    ///
    /// # Errors
    /// A surface that this map cannot lay out.
    fn parametrize(&self, disk: &Disk, progress: &mut dyn FnMut(Progress)) -> Result<Layout, Error>;
}

/// A layout as a parametrizer leaves it.
#[derive(Debug, Clone, PartialEq)]
pub struct Layout {
    /// One point per vertex of the disk, metres.
    pub uv: Vec<[f64; 2]>,
    /// Iterations that it took; 0 for a closed form.
    pub iterations: usize,
}

/// When an iterative minimiser stops.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct StoppingCriterion {
    /// Most iterations. Default 100 (the thesis gives none).
    pub iterations: usize,
    /// Stop when an iteration lowers the energy by less than this fraction of it. Default 1e-6.
    pub tolerance: f64,
}

impl Default for StoppingCriterion {
    fn default() -> Self {
        Self { iterations: 100, tolerance: 1e-6 }
    }
}

impl StoppingCriterion {
    pub(crate) fn check(&self) -> Result<(), Error> {
        if self.iterations == 0 {
            return Err(Error::Setting { name: "iterations", value: 0.0, must_be: "at least 1" });
        }
        if !(0.0..1.0).contains(&self.tolerance) {
            return Err(Error::Setting { name: "tolerance", value: self.tolerance, must_be: "in [0, 1)" });
        }
        Ok(())
    }
}

/// What a parametrizer is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// The injective start on a circle; one report, energy 0.
    Start,
    /// Local/global iterations.
    Arap,
    /// A cut was made by [`crate::unwrap_with_cuts`]; the iteration is the number of cuts so far.
    Cut,
    /// Closing a seam of an atlas was tried; the iteration counts them, energy 0.
    Seam,
    /// Seams that were found on a coarse surface: a chart of the fine one was laid out, or could not be; the iteration counts them, energy 0.
    Level,
    /// A chart of an atlas is finished; the iteration is its number, energy 0.
    Chart,
    /// Newton iterations on the symmetric Dirichlet energy.
    SymmetricDirichlet,
}

/// One report of a parametrizer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// What is being done.
    pub stage: Stage,
    /// Iteration of this stage, from 1.
    pub iteration: usize,
    /// Energy per area: ARAP (0 = isometry) or symmetric Dirichlet over 4 (1 = isometry).
    pub energy: f64,
}
