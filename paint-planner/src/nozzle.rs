//! Stage 1: where the nozzle should be for every target (VR paper, Eqs. (1)-(6)).

pub(crate) mod interior;
mod paper;
pub(crate) mod program;
mod repaired;
mod start;

use crate::error::Error;
use crate::settings::NozzleSettings;
use crate::target::{NozzleState, Target};
use program::Program;

pub(crate) use start::{Start, starts};

/// Which formulation stage 1 solves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Mode {
    /// The whole path in one program, directions as unit vectors, incidence as an inscribed octagon of planes.
    #[default]
    Repaired,
    /// Eqs. (2)-(6) as printed: azimuth and polar angles, three planes, Jacobi iterations.
    PaperExact,
}

/// Nozzle states with what it took to find them.
#[derive(Debug, Clone)]
pub(crate) struct Nozzles {
    /// One state per target; targets without a start keep `None`.
    pub(crate) states: Vec<Option<NozzleState>>,
    /// Rounds (repaired) or Jacobi iterations (paper-exact) done.
    pub(crate) rounds: usize,
    /// Interior-point steps, summed.
    pub(crate) steps: usize,
    /// Greatest relaxation of a soft cone row in the last round.
    pub(crate) slack: f64,
}

/// Optimises the nozzle states of all targets that have a start. `linked[i]` tells whether the pair (i, i+1) is one
/// stroke.
pub(crate) fn optimise(
    targets: &[Target],
    starts: &[Option<Start>],
    linked: &[bool],
    mode: Mode,
    settings: &NozzleSettings,
) -> Result<Nozzles, Error> {
    match mode {
        Mode::Repaired => repaired::optimise(targets, starts, linked, settings),
        Mode::PaperExact => paper::optimise(targets, starts, linked, settings),
    }
}

fn solve(program: &Program, x: &mut [nalgebra::Vector5<f64>]) -> Result<interior::Outcome, Error> {
    interior::solve(program, x).ok_or(Error::Numerical { stage: "the nozzle program" })
}

#[cfg(test)]
mod tests;
