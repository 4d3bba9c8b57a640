//! Access to the solver of stage 1 for measurements against other solvers.

use super::initial_state::initial_states;
use super::interior_point::solve;
use super::quadratic_program::QuadraticProgram;
use super::sequential::first_program;
use super::standard_form::StandardForm;
use crate::error::Error;
use crate::settings::NozzleSettings;
use crate::target::Target;
use nalgebra::Vector5;

/// The first quadratic program of stage 1 for one stroke.
#[derive(Debug, Clone)]
pub struct StageOneProgram {
    program: QuadraticProgram,
    start: Vec<Vector5<f64>>,
}

impl StageOneProgram {
    /// Linearises around the initial states of `targets`.
    pub fn new(targets: &[Target], settings: &NozzleSettings) -> Self {
        let (program, start) = first_program(targets, &initial_states(targets, settings), settings);
        Self { program, start }
    }

    /// Solves it by the crate's own interior-point method; the five coordinates of every state.
    ///
    /// # Errors
    /// A program without a feasible point.
    pub fn solve(&self) -> Result<Vec<Vector5<f64>>, Error> {
        let mut x = self.start.clone();
        solve(&self.program, &mut x)?;
        Ok(x)
    }

    /// The same program for another solver.
    pub fn standard_form(&self) -> StandardForm {
        StandardForm::new(&self.program)
    }
}
