//! Stage 1: where the nozzle should be for every target (VR paper, Eqs. (1)-(6)).

#[cfg(any(test, feature = "clarabel"))]
mod clarabel_solver;
mod dual_active_set;
mod gauss_seidel;
mod inequality_row;
mod initial_state;
mod interior_point;
mod paper_exact;
mod primal_dual_active_set;
mod qp_solver;
mod quadratic_program;

mod sequential;
mod solution;
mod standard_form;
#[cfg(test)]
mod tests;

use crate::error::Error;
pub use crate::settings::NozzleSettings;
use crate::target::Target;

#[cfg(feature = "clarabel")]
pub use clarabel_solver::Clarabel;
pub use gauss_seidel::GaussSeidel;
pub(crate) use initial_state::{InitialState, initial_states};
pub use interior_point::InteriorPoint;
pub use paper_exact::state_programs;
pub use primal_dual_active_set::PrimalDualActiveSet;
pub use qp_solver::{QpOutcome, QpSolver};
pub use quadratic_program::QuadraticProgram;
pub use sequential::stroke_program;
pub(crate) use solution::Nozzles;
pub use standard_form::StandardForm;

/// Which formulation stage 1 solves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Mode {
    /// The whole path in one program, directions as unit vectors, incidence as an inscribed octagon of planes.
    #[default]
    Sequential,
    /// Eqs. (2)-(6) in the printed variables: azimuth and polar angles, three planes, Jacobi iterations. Facets are of one size, and heading
    /// rows soft.
    PaperExact,
}

/// Optimises the nozzle states of all targets that have a start. `linked[i]` tells whether the pair (i, i+1) is one
/// stroke.
pub(crate) fn optimise(
    targets: &[Target],
    initial_states: &[Option<InitialState>],
    linked: &[bool],
    mode: Mode,
    solver: &dyn QpSolver,
    settings: &NozzleSettings,
) -> Result<Nozzles, Error> {
    match mode {
        Mode::Sequential => sequential::optimise(targets, initial_states, linked, solver, settings),
        Mode::PaperExact => paper_exact::optimise(targets, initial_states, linked, solver, settings),
    }
}
