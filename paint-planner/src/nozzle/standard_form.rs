//! The program in the form that general solvers take: `min 1/2 x'Px + q'x` subject to `A x <= b`.

use super::quadratic_program::QuadraticProgram;
use nalgebra::Vector5;

/// Row, column and value of every entry that is not zero by construction.
type Triplets = Vec<(usize, usize, f64)>;

/// Variables: five per state, then one relaxation per soft row.
#[derive(Debug, Clone)]
pub struct StandardForm {
    /// Number of variables; the first `states` of them are the states.
    pub variables: usize,
    /// Five times the number of states.
    pub states: usize,
    /// Upper triangle of `P`.
    pub p: Triplets,
    /// `q`.
    pub q: Vec<f64>,
    /// `A`.
    pub a: Triplets,
    /// `b`, as long as `A` has rows.
    pub b: Vec<f64>,
}

impl StandardForm {
    /// The matrices of a program.
    pub fn new(program: &QuadraticProgram) -> Self {
        let (count, hard, soft) = (program.gradient.len(), program.hard_rows, program.soft_rows);
        let (states, per_state) = (5 * count, hard + soft);
        let variables = states + soft * count;
        let mut p = Triplets::new();
        let mut upper = |r: usize, c: usize, v: f64| {
            if r <= c {
                p.push((r, c, v));
            }
        };
        for i in 0..count {
            for r in 0..5 {
                for c in 0..5 {
                    upper(5 * i + r, 5 * i + c, program.hessian.diagonal[i][(r, c)]);
                    if i + 1 < count {
                        upper(5 * i + c, 5 * i + 5 + r, program.hessian.lower[i][(r, c)]);
                    }
                }
            }
        }
        let mut q: Vec<f64> = program.gradient.iter().flat_map(|g| g.iter().copied()).collect();
        q.resize(variables, program.penalty);
        let (mut a, mut b) = (Triplets::new(), Vec::new());
        for (j, row) in program.rows.iter().enumerate() {
            let (i, k) = (j / per_state, j % per_state);
            let mut line = Vector5::zeros();
            if k < hard {
                line.fixed_rows_mut::<3>(0).copy_from(&row.a);
            } else {
                line = program.soft_map[i].tr_mul(&row.a.xy());
                a.push((j, states + soft * i + k - hard, -1.0));
            }
            a.extend((0..5).map(|r| (j, 5 * i + r, line[r])));
            b.push(row.b);
        }
        for relaxation in states..variables {
            a.push((b.len(), relaxation, -1.0));
            b.push(0.0);
        }
        Self { variables, states, p, q, a, b }
    }

    /// Counts the states from `start`: `x = start + y` with the new variables `y`; a constant of the objective is dropped.
    pub fn move_to(&mut self, start: &[f64]) {
        for &(r, c, v) in self.p.iter().filter(|(r, c, _)| *r < start.len() && *c < start.len()) {
            self.q[r] += v * start[c];
            if r != c {
                self.q[c] += v * start[r];
            }
        }
        for &(row, column, v) in self.a.iter().filter(|(_, column, _)| *column < start.len()) {
            self.b[row] -= v * start[column];
        }
    }
}
