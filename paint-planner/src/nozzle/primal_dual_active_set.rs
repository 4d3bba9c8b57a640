//! The primal-dual active-set method (Hintermueller, Ito and Kunisch 2003) for [`QuadraticProgram`]: every round is one
//! block-tridiagonal factorisation with the rows that bind as equations.
//!
//! The interior-point method needs three to thirteen times as long on strokes (`library_figures planner`): few of their rows bind, and a round is two passes over the
//! states where a step of that method is four.

use super::interior_point::InteriorPoint;
use super::qp_solver::{QpOutcome, QpSolver};
use super::quadratic_program::{QuadraticProgram, Row};
use crate::block_tridiagonal::BlockTridiagonal;
use crate::error::Error;
use nalgebra::{Matrix3, Vector3, Vector5};

/// Rounds after which the rows that bind count as not found.
const MAX_ROUNDS: usize = 20;
/// Weight of a binding row against the greatest of the Hessian: what is left of its excess shrinks by this in a round.
const STIFFNESS: f64 = 1e7;
/// Greatest violation of a row, product of slack and multiplier, and slope (relative to the steepest at the start) of a solution.
const PRIMAL: f64 = 1e-10;
const PRODUCT: f64 = 1e-11;
const DUAL: f64 = 1e-9;

/// The crate's own solver: guesses which rows bind, solves for these as equations, and corrects the guess by the signs of multipliers
/// and excesses until it holds. The answer is exact to rounding.
///
/// Nothing proves that the guesses end; where they do not, [`InteriorPoint`] solves the program.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct PrimalDualActiveSet;

impl QpSolver for PrimalDualActiveSet {
    /// `steps` counts the rounds and, where they did not settle, the steps of the interior-point method as well. Fails as that does.
    fn solve(&self, program: &QuadraticProgram, states: &mut [Vector5<f64>]) -> Result<QpOutcome, Error> {
        let mut iterate = Iterate::new(program, states);
        let mut steps = 0;
        while steps < MAX_ROUNDS
            && let Some(at) = iterate.advance_and_factor()
        {
            if at.primal <= PRIMAL && at.product <= PRODUCT && at.dual <= DUAL * (1.0 + iterate.steepest) {
                let moved = iterate.moved;
                states.iter_mut().zip(&moved).for_each(|(state, moved)| *state += moved);
                return Ok(QpOutcome { steps, slack: at.slack });
            }
            iterate.finish();
            steps += 1;
        }
        let outcome = InteriorPoint.solve(program, states)?;
        Ok(QpOutcome { steps: steps + outcome.steps, ..outcome })
    }
}

/// How far an iterate is from the solution.
#[derive(Debug, Clone, Copy, Default)]
struct Optimality {
    /// Greatest excess of a row that may not be exceeded, product of a multiplier and the distance from its row, slope of the Lagrangian.
    primal: f64,
    product: f64,
    dual: f64,
    /// Greatest relaxation of a soft row.
    slack: f64,
}

/// A row as the rounds see it. It is idle while its multiplier is zero and it does not bind; a soft one may also stand at the penalty.
#[derive(Debug, Clone, Copy, Default)]
struct RowState {
    /// `a.q - b`. Steps are added to it: the last digit of a position is a force where the row is stiff.
    excess: f64,
    multiplier: f64,
    /// Solved for as an equation.
    binds: bool,
}

/// What the rows of one state add up to, on the coordinates that they see.
#[derive(Debug, Clone, Copy)]
struct Sums {
    /// `A' z`.
    held: Vector3<f64>,
    /// What binding rows ask for beside that, as springs that begin at their multipliers, and the springs' curvature.
    pull: Vector3<f64>,
    curvature: Matrix3<f64>,
}

/// Rows, the factorised system, and the step.
struct Iterate<'a> {
    program: &'a QuadraticProgram,
    rows: Vec<RowState>,
    system: BlockTridiagonal<5>,
    /// The states, counted from the start: far from the origin of the world their digits would not do. And the slope there.
    moved: Vec<Vector5<f64>>,
    slope: Vec<Vector5<f64>>,
    step: Vec<Vector5<f64>>,
    /// Greatest slope at the start.
    steepest: f64,
    /// Of the springs that stand for equations.
    stiffness: f64,
}

impl<'a> Iterate<'a> {
    fn new(program: &'a QuadraticProgram, start: &'a [Vector5<f64>]) -> Self {
        let slope: Vec<Vector5<f64>> =
            (0..start.len()).map(|i| program.curvature_times(start, i) + program.gradient[i]).collect();
        let steepest = slope.iter().fold(0.0_f64, |most, slope| most.max(slope.amax()));
        let per_state = (program.hard_rows + program.soft_rows).max(1);
        let rows = program.rows.iter().enumerate().map(|(k, row)| {
            let (p, w) = program.views(k / per_state, &start[k / per_state]);
            let along = if k % per_state < program.hard_rows { row.a.dot(&p) } else { row.a.xy().dot(&w) };
            RowState { excess: along - row.b, multiplier: 0.0, binds: false }
        });
        let greatest = program.hessian.diagonal.iter().fold(0.0_f64, |most, block| most.max(block.diagonal().amax()));
        Self {
            program,
            rows: rows.collect(),
            system: program.hessian.clone(),
            moved: vec![Vector5::zeros(); start.len()],
            slope,
            step: vec![Vector5::zeros(); start.len()],
            steepest,
            stiffness: STIFFNESS * greatest,
        }
    }

    /// Goes the last step, decides which rows bind next, factorises their system, and begins its solution. `None` where it is not
    /// positive definite.
    fn advance_and_factor(&mut self) -> Option<Optimality> {
        let program = self.program;
        let mut at = Optimality::default();
        // The slope asks for the next state as well, so that goes its step one turn earlier.
        let mut next = self.advance_state(0, &mut at);
        for i in 0..self.moved.len() {
            let Some((hard, soft)) = next else { break };
            next = self.advance_state(i + 1, &mut at);
            let map = &program.soft_map[i];
            let to_state = |hard: &Vector3<f64>, soft: &Vector3<f64>| {
                let mut sum = map.tr_mul(&soft.xy());
                (0..3).for_each(|k| sum[k] += hard[k]);
                sum
            };
            let slope = program.curvature_times(&self.moved, i) + self.slope[i] + to_state(&hard.held, &soft.held);
            at.dual = at.dual.max(slope.amax());
            let mut block = program.hessian.diagonal[i];
            if hard.curvature != Matrix3::zeros() {
                let mut place = block.fixed_view_mut::<3, 3>(0, 0);
                place += hard.curvature;
            }
            if soft.curvature != Matrix3::zeros() {
                block += map.tr_mul(&(soft.curvature.fixed_view::<2, 2>(0, 0) * map));
            }
            self.system.diagonal[i] = block;
            if let Some(below) = program.hessian.lower.get(i) {
                self.system.lower[i] = *below;
            }
            if !self.system.factor_block(i) {
                return None;
            }
            self.step[i] = -slope - to_state(&hard.pull, &soft.pull);
            self.system.forward_block(i, &mut self.step);
        }
        Some(at)
    }

    /// Ends the solution.
    fn finish(&mut self) {
        (0..self.moved.len()).rev().for_each(|i| self.system.backward_block(i, &mut self.step));
    }

    /// Goes the last step with state `i`, if there is such, and returns what its hard and soft rows ask for there.
    fn advance_state(&mut self, i: usize, at: &mut Optimality) -> Option<(Sums, Sums)> {
        if i >= self.moved.len() {
            return None;
        }
        let program = self.program;
        let (p, w) = program.views(i, &self.step[i]);
        self.moved[i] += self.step[i];
        let per_state = program.hard_rows + program.soft_rows;
        let rows = &program.rows[i * per_state..][..per_state];
        let states = &mut self.rows[i * per_state..][..per_state];
        let ((hard, soft), (hard_states, soft_states)) =
            (rows.split_at(program.hard_rows), states.split_at_mut(program.hard_rows));
        Some((
            advance_rows(hard, hard_states, &p, self.stiffness, f64::INFINITY, at),
            advance_rows(soft, soft_states, &w.push(0.0), self.stiffness, program.penalty, at),
        ))
    }
}

/// Goes a step with the rows of one kind of a state: their multipliers, and which of them bind next. Rows begin to bind one at a time,
/// the most exceeded first: more of them than a state has coordinates would fight.
#[inline]
fn advance_rows(
    rows: &[Row],
    states: &mut [RowState],
    step: &Vector3<f64>,
    stiffness: f64,
    limit: f64,
    at: &mut Optimality,
) -> Sums {
    let mut sums = Sums { held: Vector3::zeros(), pull: Vector3::zeros(), curvature: Matrix3::zeros() };
    let mut most = (0.0, None);
    for (k, (row, state)) in rows.iter().zip(&mut *states).enumerate() {
        state.excess += row.a.dot(step);
        let y = state.excess;
        if state.multiplier == 0.0 && !state.binds {
            if y > most.0 {
                most = (y, Some(k));
            }
            continue;
        }
        if state.binds {
            let reached = state.multiplier + stiffness * y;
            state.binds = reached > 0.0 && reached < limit;
            state.multiplier = reached.clamp(0.0, limit);
        } else {
            state.binds = y < 0.0;
        }
        let z = state.multiplier;
        if z < limit {
            at.primal = at.primal.max(y);
            at.product = at.product.max(z * y.abs());
        } else {
            at.slack = at.slack.max(y);
            at.product = at.product.max(-z * y);
        }
        sums.held += row.a * z;
        if state.binds {
            sums.bind(&row.a, y, stiffness);
        }
    }
    at.primal = at.primal.max(most.0);
    if let (y, Some(k)) = most {
        states[k].binds = true;
        sums.bind(&rows[k].a, y, stiffness);
    }
    sums
}

impl Sums {
    fn bind(&mut self, a: &Vector3<f64>, y: f64, stiffness: f64) {
        self.pull += a * (stiffness * y);
        self.curvature += a * a.transpose() * stiffness;
    }
}
