//! Clarabel, the general interior-point solver, for the programs of stage 1 (Goulart and Chen 2024).

use super::qp_solver::{QpOutcome, QpSolver};
use super::quadratic_program::QuadraticProgram;
use super::standard_form::StandardForm;
use crate::error::Error;
use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, NonnegativeConeT, SolverStatus};
use nalgebra::Vector5;

/// Takes the programs as general sparse ones: an independent answer to compare with, at thirty times the price.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Clarabel {
    /// Feasibility and duality gap at which a solution counts as found, absolute and relative. Default 1e-12.
    pub tolerance: f64,
    /// Iterations at most. Default 200.
    pub max_iterations: u32,
}

impl Default for Clarabel {
    fn default() -> Self {
        Self { tolerance: 1e-12, max_iterations: 200 }
    }
}

impl QpSolver for Clarabel {
    fn solve(&self, program: &QuadraticProgram, states: &mut [Vector5<f64>]) -> Result<QpOutcome, Error> {
        let failed = Error::Numerical { stage: "the nozzle program, solved by Clarabel," };
        let mut form = StandardForm::new(program);
        // Its tolerances are relative to the objective, and that of states far from the origin is large: they count from where they start.
        let start: Vec<f64> = states.iter().flat_map(|state| state.iter().copied()).collect();
        form.move_to(&start);
        let matrix = |rows: usize, triplets: &[(usize, usize, f64)]| {
            let (r, (c, v)): (Vec<usize>, (Vec<usize>, Vec<f64>)) =
                triplets.iter().map(|&(r, c, v)| (r, (c, v))).unzip();
            CscMatrix::new_from_triplets(rows, form.variables, r, c, v)
        };
        let (p, a) = (matrix(form.variables, &form.p), matrix(form.b.len(), &form.a));
        let settings = DefaultSettings {
            verbose: false,
            tol_gap_abs: self.tolerance,
            tol_gap_rel: self.tolerance,
            tol_feas: self.tolerance,
            max_iter: self.max_iterations,
            ..DefaultSettings::default()
        };
        let cones = [NonnegativeConeT(form.b.len())];
        let mut solver = DefaultSolver::new(&p, &form.q, &a, &form.b, &cones, settings).map_err(|_| failed.clone())?;
        solver.solve();
        let solution = &solver.solution;
        // Almost solved: within Clarabel's own looser tolerances, which lie below a micrometre here.
        if !matches!(solution.status, SolverStatus::Solved | SolverStatus::AlmostSolved) {
            return Err(failed);
        }
        let (found, relaxations) = solution.x.split_at(form.states);
        for (state, found) in states.iter_mut().zip(found.chunks_exact(5)) {
            *state += Vector5::from_column_slice(found);
        }
        let slack = relaxations.iter().copied().fold(0.0, f64::max);
        Ok(QpOutcome { steps: solution.iterations as usize, slack })
    }
}
