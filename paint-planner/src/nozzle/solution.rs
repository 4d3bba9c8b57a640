//! The result of stage 1.

use crate::not_served::NotServed;
use crate::target::NozzleState;

/// Nozzle states with what it took to find them.
#[derive(Debug, Clone)]
pub(crate) struct Nozzles {
    /// One state per target, or why it has none.
    pub(crate) states: Vec<Result<NozzleState, NotServed>>,
    /// Rounds (sequential) or Jacobi iterations (paper-exact) done.
    pub(crate) rounds: usize,
    /// Steps of the solver, summed.
    pub(crate) steps: usize,
    /// Greatest relaxation of a soft cone row in the last round.
    pub(crate) slack: f64,
}
