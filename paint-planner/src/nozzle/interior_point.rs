//! Mehrotra's predictor-corrector interior-point method for [`QuadraticProgram`]: every step is one block-tridiagonal
//! factorisation and two substitutions, fused with the work on the rows into four passes over the states.
//!
//! It gets where the guesses of the active set go round in circles. Kept beside Clarabel, which solves the same program as a general
//! sparse one at twenty times the price (`library_figures planner`). Rows are taken one at a time: four side by side, by types of our own or the crate
//! `wide`, would save a quarter of the time of a method that seldom runs, at the price of a dependency or a hundred lines.

use super::inequality_row::{HardRow, Reach, Residuals, SoftRow, Step, Sums};
use super::qp_solver::{QpOutcome, QpSolver};
use super::quadratic_program::QuadraticProgram;
use crate::block_tridiagonal::BlockTridiagonal;
use crate::error::Error;
use nalgebra::{Matrix2, Vector2, Vector3, Vector5};

const MAX_STEPS: usize = 60;
/// Products of slack and multiplier that the last steps aim at: smaller ones leave no digits to the rows whose product is still
/// larger. Positions are in metres and weights of order one.
const LEAST_PRODUCT: f64 = 1e-13;
/// The greatest product at which a solution counts as found: the mean says little of a single row.
const WORST: f64 = 1e-11;
const PRIMAL: f64 = 1e-10;
const DUAL: f64 = 1e-9;
/// First complementarity as a share of the steepest slope: a start near the scale of the answer saves half the steps.
const INITIAL_MU: f64 = 1e-4;
/// Share of the way to the boundary that a step goes: every product stays positive.
const INSIDE: f64 = 0.9995;

/// Mehrotra's method with the structure of the programs in its factorisation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct InteriorPoint;

impl QpSolver for InteriorPoint {
    /// `states` should satisfy the hard rows strictly. Fails when the factorisation breaks down or the steps run out: the hard rows
    /// admit no point.
    fn solve(&self, program: &QuadraticProgram, states: &mut [Vector5<f64>]) -> Result<QpOutcome, Error> {
        let singular = Error::Numerical { stage: "the nozzle program" };
        let mut iterate = Iterate::new(program, states);
        for steps in 0..MAX_STEPS {
            let Some(at) = iterate.advance_and_factor() else { return Err(singular) };
            if at.worst <= WORST && at.primal <= PRIMAL && at.dual <= DUAL * (1.0 + iterate.steepest) {
                states.iter_mut().zip(&iterate.moved).for_each(|(state, moved)| *state += moved);
                return Ok(QpOutcome { steps, slack: iterate.slack() });
            }
            let after = iterate.predict();
            iterate.target = (after / at.mu).clamp(0.0, 1.0).powi(3) * at.mu;
            iterate.target = iterate.target.max(LEAST_PRODUCT);
            iterate.correct();
            iterate.length = (INSIDE * iterate.finish()).min(1.0);
        }
        Err(singular)
    }
}

/// How far an iterate is from the solution: mean and greatest product of slacks and multipliers, greatest errors of rows and slopes.
struct Optimality {
    mu: f64,
    worst: f64,
    primal: f64,
    dual: f64,
}

/// A step as the hard rows of a state see it, and as the soft ones do.
type RowSteps = (Step<Vector3<f64>>, Step<Vector2<f64>>);

/// Rows and their multipliers, the factorised Newton system, and the step.
struct Iterate<'a> {
    program: &'a QuadraticProgram,
    hard: Vec<HardRow>,
    soft: Vec<SoftRow>,
    /// Rows of each kind that a state has.
    per_state: [usize; 2],
    system: BlockTridiagonal<5>,
    /// The states, counted from the start: far from the origin of the world their digits would not do. And the slope there.
    moved: Vec<Vector5<f64>>,
    slope: Vec<Vector5<f64>>,
    /// The step towards complementarity zero, and what the correction adds.
    step: Vec<Vector5<f64>>,
    correction: Vec<Vector5<f64>>,
    /// Products that the correction leads to, and the share of the step that is gone.
    target: f64,
    length: f64,
    /// Greatest slope at the start.
    steepest: f64,
    /// Number of products that are driven to zero, and their sum.
    products: f64,
    gap: f64,
}

impl<'a> Iterate<'a> {
    fn new(program: &'a QuadraticProgram, x: &[Vector5<f64>]) -> Self {
        let slope: Vec<Vector5<f64>> =
            (0..x.len()).map(|i| program.curvature_times(x, i) + program.gradient[i]).collect();
        let steepest = slope.iter().fold(0.0_f64, |most, slope| most.max(slope.amax()));
        let mu = (INITIAL_MU * steepest).max(1e-9);
        let per_state = [program.hard_rows, program.soft_rows];
        let (mut hard, mut soft) =
            (Vec::with_capacity(per_state[0] * x.len()), Vec::with_capacity(per_state[1] * x.len()));
        for (i, rows) in program.rows.chunks_exact(program.hard_rows + program.soft_rows).enumerate() {
            let (p, w) = program.views(i, &x[i]);
            let (hard_rows, soft_rows) = rows.split_at(program.hard_rows);
            hard.extend(hard_rows.iter().map(|row| HardRow::new(row, &p, mu)));
            soft.extend(soft_rows.iter().map(|row| SoftRow::new(row, &w, mu, program.penalty)));
        }
        let products = (hard.len() + 2 * soft.len()).max(1) as f64;
        Self {
            program,
            hard,
            soft,
            per_state,
            system: program.hessian.clone(),
            moved: vec![Vector5::zeros(); x.len()],
            slope,
            step: vec![Vector5::zeros(); x.len()],
            correction: vec![Vector5::zeros(); x.len()],
            target: 0.0,
            length: 0.0,
            steepest,
            products,
            gap: 0.0,
        }
    }

    /// Greatest relaxation of a soft row.
    fn slack(&self) -> f64 {
        self.soft.iter().fold(0.0, |worst, row| worst.max(row.relaxation()))
    }

    /// Goes the last step, factorises the Newton system there, and begins its solution. `None` where it is not positive definite.
    fn advance_and_factor(&mut self) -> Option<Optimality> {
        let (program, penalty) = (self.program, self.program.penalty);
        let mut at = Residuals::default();
        let mut dual = 0.0_f64;
        // The slope asks for the next state as well, so that goes its step one turn earlier.
        let mut next = self.advance_state(0);
        for i in 0..self.moved.len() {
            let Some((hard_step, soft_step)) = next else { break };
            next = self.advance_state(i + 1);
            let (p, w) = program.views(i, &self.moved[i]);
            let (mut hard, mut soft) = (Sums::<3, 6>::zero(), Sums::<2, 3>::zero());
            for row in &mut self.hard[i * self.per_state[0]..][..self.per_state[0]] {
                row.advance(&hard_step, &p, &mut hard, &mut at);
            }
            for row in &mut self.soft[i * self.per_state[1]..][..self.per_state[1]] {
                row.advance(&soft_step, penalty, &w, &mut soft, &mut at);
            }
            let slope = program.curvature_times(&self.moved, i) + self.slope[i];
            dual = dual.max((slope + self.to_state(i, &hard.held, &soft.held)).amax());
            let soft_map = &program.soft_map[i];
            let [xx, xy, yy] = soft.curvature;
            let mut block = program.hessian.diagonal[i] + soft_map.tr_mul(&(Matrix2::new(xx, xy, xy, yy) * soft_map));
            // Only the lower triangle is read.
            let places = [(0, 0), (1, 0), (2, 0), (1, 1), (2, 1), (2, 2)];
            for (place, curvature) in places.into_iter().zip(&hard.curvature) {
                block[place] += curvature;
            }
            self.system.diagonal[i] = block;
            if let Some(below) = program.hessian.lower.get(i) {
                self.system.lower[i] = *below;
            }
            if !self.system.factor_block(i) {
                return None;
            }
            self.step[i] = -slope - self.to_state(i, &hard.pull, &soft.pull);
            self.system.forward_block(i, &mut self.step);
        }
        self.gap = at.gap;
        Some(Optimality { mu: self.gap / self.products, worst: at.worst, primal: at.primal, dual })
    }

    /// Goes the last step with state `i`, if there is such, and returns it as its rows see it.
    fn advance_state(&mut self, i: usize) -> Option<RowSteps> {
        if i >= self.moved.len() {
            return None;
        }
        let step = self.step_of(i);
        self.moved[i] += (self.step[i] + self.correction[i]) * self.length;
        Some(step)
    }

    fn step_of(&self, i: usize) -> RowSteps {
        let [at, predicted, correction] =
            [&self.moved, &self.step, &self.correction].map(|states| self.program.views(i, &states[i]));
        let (target, length) = (self.target, self.length);
        (
            Step { at: at.0, predicted: predicted.0, correction: correction.0, target, length },
            Step { at: at.1, predicted: predicted.1, correction: correction.1, target, length },
        )
    }

    /// The step towards complementarity zero; returns the mean product that it would lead to.
    fn predict(&mut self) -> f64 {
        let mut reach = Reach::default();
        for i in (0..self.moved.len()).rev() {
            self.system.backward_block(i, &mut self.step);
            let (hard_step, soft_step) = self.step_of(i);
            for row in &self.hard[i * self.per_state[0]..][..self.per_state[0]] {
                row.predict(&hard_step, &mut reach);
            }
            for row in &self.soft[i * self.per_state[1]..][..self.per_state[1]] {
                row.predict(self.program.penalty, &soft_step, &mut reach);
            }
        }
        let length = 1.0 / reach.inverse.max(1.0);
        // Each product changes by minus itself, and by the product of the changes.
        ((1.0 - length) * self.gap + length * length * reach.cross) / self.products
    }

    /// Begins the solution for what products of `target` and the second order add to the step.
    fn correct(&mut self) {
        for i in 0..self.moved.len() {
            let (hard_step, soft_step) = self.step_of(i);
            let (mut hard, mut soft) = ([0.0; 3], [0.0; 2]);
            for row in &self.hard[i * self.per_state[0]..][..self.per_state[0]] {
                row.correct(&hard_step, &mut hard);
            }
            for row in &self.soft[i * self.per_state[1]..][..self.per_state[1]] {
                row.correct(self.program.penalty, &soft_step, &mut soft);
            }
            self.correction[i] = -self.to_state(i, &hard, &soft);
            self.system.forward_block(i, &mut self.correction);
        }
    }

    /// Finds it; returns the share of the whole step that keeps slacks, multipliers and relaxations positive.
    fn finish(&mut self) -> f64 {
        let mut inverse = 0.0;
        for i in (0..self.moved.len()).rev() {
            self.system.backward_block(i, &mut self.correction);
            let (hard_step, soft_step) = self.step_of(i);
            for row in &self.hard[i * self.per_state[0]..][..self.per_state[0]] {
                row.finish(&hard_step, &mut inverse);
            }
            for row in &self.soft[i * self.per_state[1]..][..self.per_state[1]] {
                row.finish(self.program.penalty, &soft_step, &mut inverse);
            }
        }
        1.0 / inverse.max(f64::MIN_POSITIVE)
    }

    /// Forces of hard and soft rows, back to the five coordinates of state `i`.
    fn to_state(&self, i: usize, hard: &[f64; 3], soft: &[f64; 2]) -> Vector5<f64> {
        let mut sum = self.program.soft_map[i].tr_mul(&Vector2::from(*soft));
        let position = Vector3::from(*hard);
        for k in 0..3 {
            sum[k] += position[k];
        }
        sum
    }
}
