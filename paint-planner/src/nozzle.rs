//! Stage 1: where the nozzle should be for every target (VR paper, Eqs. (1)-(6)).

mod initial_state;
mod interior_point;
#[cfg(feature = "measure")]
mod measure;
mod paper_exact;
mod quadratic_program;
mod sequential;
mod solution;
#[cfg(any(test, feature = "measure"))]
mod standard_form;
#[cfg(test)]
mod tests;

use crate::error::Error;
use crate::settings::NozzleSettings;
use crate::target::Target;

pub(crate) use initial_state::{InitialState, initial_states};
#[cfg(feature = "measure")]
pub use measure::StageOneProgram;
pub(crate) use solution::Nozzles;
#[cfg(feature = "measure")]
pub use standard_form::StandardForm;

/// Which formulation stage 1 solves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Mode {
    /// The whole path in one program, directions as unit vectors, incidence as an inscribed octagon of planes.
    #[default]
    Sequential,
    /// Eqs. (2)-(6) as printed: azimuth and polar angles, three planes, Jacobi iterations.
    PaperExact,
}

/// Optimises the nozzle states of all targets that have a start. `linked[i]` tells whether the pair (i, i+1) is one
/// stroke.
pub(crate) fn optimise(
    targets: &[Target],
    initial_states: &[Option<InitialState>],
    linked: &[bool],
    mode: Mode,
    settings: &NozzleSettings,
) -> Result<Nozzles, Error> {
    match mode {
        Mode::Sequential => sequential::optimise(targets, initial_states, linked, settings),
        Mode::PaperExact => paper_exact::optimise(targets, initial_states, linked, settings),
    }
}
