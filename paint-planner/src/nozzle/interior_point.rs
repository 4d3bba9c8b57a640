//! Mehrotra's predictor-corrector interior-point method for [`QuadraticProgram`]: every step is one block-tridiagonal
//! factorisation and two substitutions.
//!
//! Kept beside Clarabel, which solves the same program as a general sparse one, because it takes a thirtieth of the time: 9.6 ms for
//! 287 on a stroke of the built-in wall, in one run (`cargo bench -p paintcopter-benches --bench paint_planner`).

use super::qp_solver::{QpOutcome, QpSolver};
use super::quadratic_program::{QuadraticProgram, Row};
use crate::block_tridiagonal::BlockTridiagonal;
use crate::error::Error;
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3, Vector5};

const MAX_STEPS: usize = 60;
/// Complementarity at which a solution counts as found; positions are in metres and weights of order one.
const MU: f64 = 1e-13;
const PRIMAL: f64 = 1e-10;
const DUAL: f64 = 1e-9;
/// First complementarity as a share of the steepest slope: a start near the scale of the answer saves half the steps.
const INITIAL_MU: f64 = 1e-3;

/// The crate's own solver: Mehrotra's method with the structure of the programs in its factorisation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct InteriorPoint;

impl QpSolver for InteriorPoint {
    fn solve(&self, program: &QuadraticProgram, states: &mut [Vector5<f64>]) -> Result<QpOutcome, Error> {
        solve(program, states)
    }
}

/// A row with its slack `s`, multiplier `z` and relaxation `e`: `a.q - e + s = b`, `s z -> 0`, `e (penalty - z) -> 0`.
#[derive(Debug, Clone, Copy, Default)]
struct RowState {
    row: Row,
    s: f64,
    z: f64,
    e: f64,
    ds: f64,
    dz: f64,
    de: f64,
    /// `a.q - e + s - b` at the present point.
    residual: f64,
    /// `1 / z` and, for soft rows, `1 / (penalty - z)`, else 0: divisions are what a step spends its time on.
    inverse_z: f64,
    inverse_v: f64,
    /// Curvature that the row adds along its normal.
    stiffness: f64,
    /// What the complementarity targets add to the residual.
    shift: f64,
}

/// Minimises the program starting from `x`, which should satisfy the hard rows strictly. Fails when the
/// factorisation breaks down or the steps run out: the hard rows admit no point.
fn solve(program: &QuadraticProgram, x: &mut [Vector5<f64>]) -> Result<QpOutcome, Error> {
    let singular = Error::Numerical { stage: "the nozzle program" };
    let count = x.len();
    let per_state = program.hard_rows + program.soft_rows;
    let mut system = program.hessian.clone();
    let (mut dual, mut step) = (vec![Vector5::zeros(); count], vec![Vector5::zeros(); count]);
    program.slope(x, &mut dual);
    let steepest = dual.iter().fold(0.0_f64, |most, d| most.max(d.amax()));
    let mut rows = start(program, x, (INITIAL_MU * steepest).max(1e-9));
    for steps in 0..MAX_STEPS {
        let (mut primal, mut gap, mut products) = (0.0_f64, 0.0, 0.0);
        program.slope(x, &mut dual);
        for (i, chunk) in rows.chunks_exact_mut(per_state).enumerate() {
            let views = program.views(i, &x[i]);
            let mut forces = [Vector3::zeros(); 2];
            for (k, r) in chunk.iter_mut().enumerate() {
                let kind = usize::from(k >= program.hard_rows);
                r.residual = r.row.a.dot(&views[kind]) - r.e + r.s - r.row.b;
                primal = primal.max(r.residual.abs());
                gap += r.s * r.z + r.e * (program.penalty - r.z);
                products += 1.0 + kind as f64;
                forces[kind] += r.row.a * r.z;
            }
            dual[i] += to_state(program, i, &forces);
        }
        let mu = gap / products.max(1.0);
        let dual_error = dual.iter().fold(0.0_f64, |worst, d| worst.max(d.amax()));
        if mu <= MU && primal <= PRIMAL && dual_error <= DUAL * (1.0 + steepest) {
            return Ok(QpOutcome { steps, slack: rows.iter().fold(0.0, |worst, r| worst.max(r.e)) });
        }
        assemble(program, &mut rows, &mut system);
        if !system.factor() {
            return Err(singular);
        }
        newton_direction(program, &system, &mut rows, &dual, &mut step, 0.0, false);
        let reach = step_length(program, &rows);
        let mut after = 0.0;
        for (j, r) in rows.iter().enumerate() {
            after += (r.s + reach * r.ds) * (r.z + reach * r.dz);
            if j % per_state >= program.hard_rows {
                after += (r.e + reach * r.de) * (program.penalty - r.z - reach * r.dz);
            }
        }
        let centring = (after / gap).clamp(0.0, 1.0).powi(3);
        newton_direction(program, &system, &mut rows, &dual, &mut step, centring * mu, true);
        // 0.995 of the way to the boundary keeps every product positive.
        let length = (0.995 * self::step_length(program, &rows)).min(1.0);
        for (state, change) in x.iter_mut().zip(&step) {
            *state += change * length;
        }
        for r in &mut rows {
            r.s += length * r.ds;
            r.z += length * r.dz;
            r.e += length * r.de;
        }
    }
    Err(singular)
}

fn start(program: &QuadraticProgram, x: &[Vector5<f64>], mu: f64) -> Vec<RowState> {
    let per_state = program.hard_rows + program.soft_rows;
    let mut rows = Vec::with_capacity(program.rows.len());
    for (i, chunk) in program.rows.chunks_exact(per_state).enumerate() {
        let views = program.views(i, &x[i]);
        for (k, row) in chunk.iter().enumerate() {
            let soft = k >= program.hard_rows;
            let room = row.b - row.a.dot(&views[usize::from(soft)]);
            let s = room.max(1e-3);
            let z = if soft { (mu / s).min(0.5 * program.penalty) } else { mu / s };
            let e = if soft { mu / (program.penalty - z) } else { 0.0 };
            rows.push(RowState { row: *row, s, z, e, ..RowState::default() });
        }
    }
    rows
}

/// Forces of hard and soft rows, back to the five coordinates of state `i`.
fn to_state(program: &QuadraticProgram, i: usize, forces: &[Vector3<f64>; 2]) -> Vector5<f64> {
    let mut sum = program.soft_map[i].tr_mul(&Vector2::new(forces[1].x, forces[1].y));
    for k in 0..3 {
        sum[k] += forces[0][k];
    }
    sum
}

impl RowState {
    /// Quantities that stay the same for both directions of one step.
    fn prepare(&mut self, soft: bool, penalty: f64) {
        self.inverse_z = 1.0 / self.z;
        self.inverse_v = if soft { 1.0 / (penalty - self.z) } else { 0.0 };
        self.stiffness = 1.0 / (self.s * self.inverse_z + self.e * self.inverse_v);
    }

    /// Right-hand sides of `s z = target` and `e (penalty - z) = target`, second-order terms included on request.
    fn complementarity(&self, penalty: f64, target: f64, second: bool) -> (f64, f64) {
        let (cross_s, cross_e) = if second { (self.ds * self.dz, self.de * self.dz) } else { (0.0, 0.0) };
        (target - self.s * self.z - cross_s, target - self.e * (penalty - self.z) + cross_e)
    }
}

/// `H + sum of stiffness a a'`.
fn assemble(program: &QuadraticProgram, rows: &mut [RowState], system: &mut BlockTridiagonal<5>) {
    system.lower.copy_from_slice(&program.hessian.lower);
    for (i, chunk) in rows.chunks_exact_mut(program.hard_rows + program.soft_rows).enumerate() {
        let mut position = Matrix3::zeros();
        let mut aim = Matrix2::zeros();
        let (hard, soft) = chunk.split_at_mut(program.hard_rows);
        for r in hard {
            r.prepare(false, program.penalty);
            let a = &r.row.a;
            let scaled = a * r.stiffness;
            position += Matrix3::from_columns(&[scaled * a.x, scaled * a.y, scaled * a.z]);
        }
        for r in soft {
            r.prepare(true, program.penalty);
            let a = &r.row.a;
            aim[(0, 0)] += a.x * a.x * r.stiffness;
            aim[(1, 0)] += a.x * a.y * r.stiffness;
            aim[(1, 1)] += a.y * a.y * r.stiffness;
        }
        aim[(0, 1)] = aim[(1, 0)];
        let soft_map = &program.soft_map[i];
        let mut block = program.hessian.diagonal[i] + soft_map.transpose() * (aim * soft_map);
        let mut corner = block.fixed_view_mut::<3, 3>(0, 0);
        corner += position;
        system.diagonal[i] = block;
    }
}

/// Newton step towards complementarity `target`; fills the steps of states and rows.
fn newton_direction(
    program: &QuadraticProgram,
    system: &BlockTridiagonal<5>,
    rows: &mut [RowState],
    dual: &[Vector5<f64>],
    step: &mut [Vector5<f64>],
    target: f64,
    second: bool,
) {
    let (per_state, penalty) = (program.hard_rows + program.soft_rows, program.penalty);
    for (i, chunk) in rows.chunks_exact_mut(per_state).enumerate() {
        let mut forces = [Vector3::zeros(); 2];
        for (k, r) in chunk.iter_mut().enumerate() {
            let (rs, re) = r.complementarity(penalty, target, second);
            r.shift = rs * r.inverse_z - re * r.inverse_v;
            forces[usize::from(k >= program.hard_rows)] += r.row.a * (r.stiffness * (r.residual + r.shift));
        }
        step[i] = -dual[i] - to_state(program, i, &forces);
    }
    system.solve(step);
    for (i, chunk) in rows.chunks_exact_mut(per_state).enumerate() {
        let views = program.views(i, &step[i]);
        for (k, r) in chunk.iter_mut().enumerate() {
            let (rs, re) = r.complementarity(penalty, target, second);
            let moved = r.row.a.dot(&views[usize::from(k >= program.hard_rows)]);
            r.dz = r.stiffness * (moved + r.residual + r.shift);
            r.ds = (rs - r.s * r.dz) * r.inverse_z;
            r.de = (re + r.e * r.dz) * r.inverse_v;
        }
    }
}

/// Largest fraction of the step that keeps slacks, multipliers and relaxations positive.
fn step_length(program: &QuadraticProgram, rows: &[RowState]) -> f64 {
    let mut reach = 1.0_f64;
    let mut limit = |value: f64, change: f64| {
        if change < 0.0 {
            reach = reach.min(-value / change);
        }
    };
    for chunk in rows.chunks_exact(program.hard_rows + program.soft_rows) {
        for (k, r) in chunk.iter().enumerate() {
            limit(r.s, r.ds);
            limit(r.z, r.dz);
            if k >= program.hard_rows {
                limit(r.e, r.de);
                limit(program.penalty - r.z, -r.dz);
            }
        }
    }
    reach
}
