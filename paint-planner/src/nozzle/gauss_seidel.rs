//! State after state, each with its own small program, until none moves any more.

use super::dual_active_set::{StateRow, minimise};
use super::qp_solver::{QpOutcome, QpSolver};
use super::quadratic_program::QuadraticProgram;
use crate::error::Error;
use nalgebra::Vector5;

/// Block Gauss-Seidel: the states in turn, each by a dual active-set method (Goldfarb and Idnani 1983) with its neighbours where they are.
/// Programs whose states do not couple, as those of [`Mode::PaperExact`](crate::nozzle::Mode::PaperExact), are solved by one sweep, to rounding; those of
/// a whole stroke take the more sweeps the stronger the smoothness, and [`PrimalDualActiveSet`](crate::nozzle::PrimalDualActiveSet) is the faster there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GaussSeidel {
    /// Greatest change of a coordinate in the last sweep. Default 1e-11.
    pub tolerance: f64,
    /// Sweeps at most. Default 5000.
    pub max_sweeps: usize,
}

impl Default for GaussSeidel {
    fn default() -> Self {
        Self { tolerance: 1e-11, max_sweeps: 5000 }
    }
}

impl QpSolver for GaussSeidel {
    /// Fails where a state's hard rows admit no point, its Hessian is not positive definite, or the sweeps run out. `steps` counts sweeps.
    fn solve(&self, program: &QuadraticProgram, states: &mut [Vector5<f64>]) -> Result<QpOutcome, Error> {
        let failed = Error::Numerical { stage: "the nozzle program, solved state by state," };
        let hessian = &program.hessian;
        let coupled = hessian.lower.iter().any(|block| block.amax() > 0.0);
        let per_state = program.hard_rows + program.soft_rows;
        let mut rows = vec![StateRow { a: [0.0; 5], b: 0.0, limit: 0.0 }; per_state];
        let mut given_up = vec![false; per_state];
        for sweep in 1..=self.max_sweeps {
            let (mut moved, mut slack) = (0.0_f64, 0.0_f64);
            for i in 0..states.len() {
                let mut gradient = program.gradient[i];
                if i > 0 && coupled {
                    gradient += hessian.lower[i - 1] * states[i - 1];
                }
                if i + 1 < states.len() && coupled {
                    gradient += hessian.lower[i].tr_mul(&states[i + 1]);
                }
                fill(&mut rows, program, i);
                let found =
                    minimise(&hessian.diagonal[i], &gradient, &rows, &mut given_up).ok_or_else(|| failed.clone())?;
                moved = moved.max((found - states[i]).amax());
                states[i] = found;
                for (row, _) in rows.iter().zip(&given_up).filter(|(_, given_up)| **given_up) {
                    slack = slack.max(Vector5::from(row.a).dot(&found) - row.b);
                }
            }
            if !coupled || moved <= self.tolerance {
                return Ok(QpOutcome { steps: sweep, slack });
            }
        }
        Err(failed)
    }
}

/// The rows of state `i` on its five coordinates.
fn fill(rows: &mut [StateRow], program: &QuadraticProgram, i: usize) {
    let own = &program.rows[i * rows.len()..(i + 1) * rows.len()];
    for (k, (row, own)) in rows.iter_mut().zip(own).enumerate() {
        row.b = own.b;
        if k < program.hard_rows {
            (row.a, row.limit) = ([own.a.x, own.a.y, own.a.z, 0.0, 0.0], f64::INFINITY);
        } else {
            row.a = program.soft_map[i].tr_mul(&own.a.xy()).into();
            row.limit = program.penalty;
        }
    }
}
