//! Who solves the quadratic programs of stage 1.

use super::quadratic_program::QuadraticProgram;
use crate::error::Error;
use nalgebra::Vector5;

/// How a solve went.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct QpOutcome {
    /// Iterations of the solver.
    pub steps: usize,
    /// Greatest relaxation of a soft row.
    pub slack: f64,
}

/// A solver for the convex quadratic programs of stage 1.
///
/// [`PrimalDualActiveSet`](crate::nozzle::PrimalDualActiveSet) and [`InteriorPoint`](crate::nozzle::InteriorPoint) know their structure; the former is the
/// default. `Clarabel` (feature `clarabel`) takes them as general sparse ones. To bring another, hand the matrices of [`StandardForm`](crate::nozzle::StandardForm) to it.
pub trait QpSolver: std::fmt::Debug + Sync {
    /// Minimises the program. `states` holds a start, which satisfies the hard rows strictly where the program has such a point, and
    /// takes the answer: five coordinates for each state.
    ///
    /// # Errors
    /// [`Error::Numerical`] where no point satisfies the hard rows, or the solver does not get there.
    fn solve(&self, program: &QuadraticProgram, states: &mut [Vector5<f64>]) -> Result<QpOutcome, Error>;
}
