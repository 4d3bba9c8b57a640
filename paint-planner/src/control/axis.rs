//! One axis over the horizon: a linear-quadratic program with bounds on its input, by Riccati recursion on a set of active bounds.

use nalgebra::{Matrix3, Matrix5, RowVector3, Vector3};

/// Position, velocity and specific force of an axis, one step of time apart: `x+ = A x + B u + E d`.
#[derive(Debug, Clone)]
pub(super) struct AxisModel {
    a: Matrix3<f64>,
    b: Vector3<f64>,
    disturbance: Vector3<f64>,
}

impl AxisModel {
    /// `p' = v`, `v' = f + d - drag v`, `tau f' = u - f`; without `lag` the input acts at once.
    pub(super) fn new(drag: f64, lag: Option<f64>, step: f64) -> Self {
        // The exponential of the continuous model with its two inputs beside the state holds all three matrices.
        let mut rates = Matrix5::zeros();
        rates[(0, 1)] = 1.0;
        rates[(1, 1)] = -drag;
        rates[(1, 4)] = 1.0;
        match lag {
            Some(lag) => {
                rates[(1, 2)] = 1.0;
                rates[(2, 2)] = -1.0 / lag;
                rates[(2, 3)] = 1.0 / lag;
            }
            None => rates[(1, 3)] = 1.0,
        }
        let moved = (rates * step).exp();
        let mut a: Matrix3<f64> = moved.fixed_view::<3, 3>(0, 0).into_owned();
        if lag.is_none() {
            a[(2, 2)] = 0.0;
        }
        Self {
            a,
            b: moved.fixed_view::<3, 1>(0, 3).into_owned(),
            disturbance: moved.fixed_view::<3, 1>(0, 4).into_owned(),
        }
    }

    /// Cost-to-go of the endless horizon without bounds: the fixed point of the Riccati recursion.
    pub(super) fn endless_cost(&self, weights: &AxisWeights) -> Matrix3<f64> {
        let stage = weights.stage(&RowVector3::new(1.0, 0.0, 0.0));
        let mut cost = stage;
        for _ in 0..ENDLESS {
            let bp = self.b.transpose() * cost;
            let gain = bp * self.a / (weights.input + (bp * self.b).x);
            let next = stage + self.a.transpose() * cost * self.a - (self.a.transpose() * bp.transpose()) * gain;
            let change = (next - cost).amax();
            cost = 0.5 * (next + next.transpose());
            if change <= 1e-12 * cost.amax() {
                break;
            }
        }
        cost
    }
}

/// Most steps of the recursion to its fixed point: its modes decay within a second.
const ENDLESS: usize = 20_000;

/// Weights of the errors of output, velocity and input.
#[derive(Debug, Clone, Copy)]
pub(super) struct AxisWeights {
    pub(super) output: f64,
    pub(super) velocity: f64,
    pub(super) input: f64,
}

impl AxisWeights {
    fn stage(&self, output: &RowVector3<f64>) -> Matrix3<f64> {
        let mut cost = output.transpose() * output * self.output;
        cost[(1, 1)] += self.velocity;
        cost
    }
}

/// What is wanted after one step: `output . x` shall be `wanted`.
#[derive(Debug, Clone, Copy)]
pub(super) struct AxisStage {
    pub(super) output: RowVector3<f64>,
    pub(super) wanted: f64,
    pub(super) velocity: f64,
    /// Input of an exact flight along the reference over this step.
    pub(super) input: f64,
}

/// Which bound holds an input.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Bound {
    Free,
    Lower,
    Upper,
}

/// The program of an axis, with the bounds that were active when it was solved last.
#[derive(Debug, Clone)]
pub(super) struct AxisProgram {
    model: AxisModel,
    weights: AxisWeights,
    last: Matrix3<f64>,
    active: Vec<Bound>,
    policy: Vec<Policy>,
    /// States after each step of the solution.
    pub(super) states: Vec<Vector3<f64>>,
    /// Its inputs.
    pub(super) inputs: Vec<f64>,
}

/// Slope of the cost in the input of one step: `input u + state . x + constant`.
#[derive(Debug, Clone, Copy)]
struct Policy {
    input: f64,
    state: RowVector3<f64>,
    constant: f64,
}

impl AxisProgram {
    pub(super) fn new(model: AxisModel, weights: AxisWeights, steps: usize) -> Self {
        let last = model.endless_cost(&weights);
        let policy = Policy { input: 1.0, state: RowVector3::zeros(), constant: 0.0 };
        Self {
            model,
            weights,
            last,
            active: vec![Bound::Free; steps],
            policy: vec![policy; steps],
            states: vec![Vector3::zeros(); steps],
            inputs: vec![0.0; steps],
        }
    }

    /// Forgets the bounds of the last solution.
    pub(super) fn reset(&mut self) {
        self.active.fill(Bound::Free);
    }

    /// The active bounds of the last solution, one step later.
    pub(super) fn shift(&mut self) {
        self.active.rotate_left(1);
        if let [.., before, last] = self.active.as_mut_slice() {
            *last = *before;
        }
    }

    /// Solves the program from `state` under a constant disturbance by the primal-dual active set method (Hintermueller, Ito and
    /// Kunisch 2003), at most `iterations` times from the active set at hand; returns whether the set is that of the optimum.
    pub(super) fn solve(
        &mut self,
        state: &Vector3<f64>,
        disturbance: f64,
        stages: &[AxisStage],
        bounds: [f64; 2],
        iterations: usize,
    ) -> bool {
        let known = self.model.disturbance * disturbance;
        for _ in 0..iterations.max(1) {
            self.backward(&known, stages, bounds);
            if !self.forward(state, &known, bounds) {
                return true;
            }
        }
        // Bounds are kept whatever comes.
        for input in &mut self.inputs {
            *input = input.clamp(bounds[0], bounds[1]);
        }
        false
    }

    fn backward(&mut self, known: &Vector3<f64>, stages: &[AxisStage], [lower, upper]: [f64; 2]) {
        let AxisModel { a, b, .. } = &self.model;
        let mut cost = Matrix3::zeros();
        let mut slope = Vector3::zeros();
        for (k, stage) in stages.iter().enumerate().rev() {
            if k + 1 == stages.len() {
                // Beyond the horizon the vehicle follows the reference as one without bounds would.
                let rest = Vector3::new(stage.wanted - stage.output[2] * stage.input, stage.velocity, stage.input);
                cost = self.last;
                slope = -(self.last * rest);
            } else {
                cost += self.weights.stage(&stage.output);
                slope -= stage.output.transpose() * (self.weights.output * stage.wanted);
                slope.y -= self.weights.velocity * stage.velocity;
            }
            let bp = b.transpose() * cost;
            let policy = Policy {
                input: self.weights.input + (bp * b).x,
                state: bp * a,
                constant: (bp * known).x + b.dot(&slope) - self.weights.input * stage.input,
            };
            self.policy[k] = policy;
            let fixed = match self.active[k] {
                Bound::Free => None,
                Bound::Lower => Some(lower),
                Bound::Upper => Some(upper),
            };
            let drift = match fixed {
                Some(input) => known + b * input,
                None => *known,
            };
            let carried = a.transpose() * (cost * drift + slope);
            let before = a.transpose() * cost * a;
            (cost, slope) = if fixed.is_some() {
                (before, carried)
            } else {
                let gain = policy.state / policy.input;
                (before - policy.state.transpose() * gain, carried - gain.transpose() * policy.constant)
            };
        }
    }

    /// Follows the policy; returns whether an active bound has changed.
    fn forward(&mut self, state: &Vector3<f64>, known: &Vector3<f64>, [lower, upper]: [f64; 2]) -> bool {
        let mut changed = false;
        let mut x = *state;
        for (k, policy) in self.policy.iter().enumerate() {
            let rest = (policy.state * x).x + policy.constant;
            let slope = |input: f64| policy.input * input + rest;
            let free = -rest / policy.input;
            let (input, active) = match self.active[k] {
                Bound::Free if free < lower => (free, Bound::Lower),
                Bound::Free if free > upper => (free, Bound::Upper),
                Bound::Free => (free, Bound::Free),
                Bound::Lower => (lower, if slope(lower) < 0.0 { Bound::Free } else { Bound::Lower }),
                Bound::Upper => (upper, if slope(upper) > 0.0 { Bound::Free } else { Bound::Upper }),
            };
            changed |= active != self.active[k];
            self.active[k] = active;
            self.inputs[k] = input;
            x = self.model.a * x + self.model.b * input + known;
            self.states[k] = x;
        }
        changed
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};
    use rand_xoshiro::SplitMix64;
    use rand_xoshiro::rand_core::{Rng as _, SeedableRng as _};

    use super::*;

    const STEPS: usize = 25;

    fn unit(random: &mut SplitMix64) -> f64 {
        (random.next_u64() >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    /// The program as one dense quadratic in the inputs: Hessian and gradient at zero. States are rolled out for each input alone.
    fn dense(
        program: &AxisProgram,
        start: &Vector3<f64>,
        disturbance: f64,
        stages: &[AxisStage],
    ) -> (DMatrix<f64>, DVector<f64>) {
        let roll = |start: Vector3<f64>, disturbance: f64, input: Option<usize>| {
            let mut x = start;
            (0..STEPS)
                .map(|k| {
                    let u = f64::from(u8::from(input == Some(k)));
                    x = program.model.a * x + program.model.b * u + program.model.disturbance * disturbance;
                    x
                })
                .collect::<Vec<_>>()
        };
        let free = roll(*start, disturbance, None);
        let answers: Vec<_> = (0..STEPS).map(|j| roll(Vector3::zeros(), 0.0, Some(j))).collect();
        let cost = |k: usize| {
            if k + 1 == STEPS { program.last } else { program.weights.stage(&stages[k].output) }
        };
        let off = |k: usize| {
            let stage = &stages[k];
            // Any state with the wanted output and velocity will do before the last.
            let at = Vector3::new(stage.wanted - stage.output[2] * stage.input, stage.velocity, stage.input);
            free[k] - at
        };
        let hessian = DMatrix::from_fn(STEPS, STEPS, |i, j| {
            let own = if i == j { program.weights.input } else { 0.0 };
            own + (0..STEPS).map(|k| (answers[i][k].transpose() * cost(k) * answers[j][k]).x).sum::<f64>()
        });
        let gradient = DVector::from_fn(STEPS, |i, _| {
            let pull = (0..STEPS).map(|k| (answers[i][k].transpose() * cost(k) * off(k)).x).sum::<f64>();
            pull - program.weights.input * stages[i].input
        });
        (hessian, gradient)
    }

    /// Against the conditions of optimality of the dense program, at random places where most bounds bite.
    #[test]
    fn inputs_are_the_optimum_within_their_bounds() {
        let mut random = SplitMix64::seed_from_u64(3);
        let weights = AxisWeights { output: 1.0, velocity: 0.01, input: 1e-5 };
        let (mut held, mut unsettled) = (0, 0);
        for round in 0..200 {
            let lag = (round % 3 > 0).then_some(0.18);
            let model = AxisModel::new(0.3, lag, 0.01);
            let mut program = AxisProgram::new(model, weights, STEPS);
            let mut number = |size: f64| size * unit(&mut random);
            let stages: Vec<AxisStage> = (0..STEPS)
                .map(|_| AxisStage {
                    output: RowVector3::new(1.0, 0.0, if lag.is_some() { number(0.01) } else { 0.0 }),
                    wanted: number(0.02),
                    velocity: number(0.2),
                    input: number(2.0),
                })
                .collect();
            let start = Vector3::new(number(0.05), number(0.3), if lag.is_some() { number(3.0) } else { 0.0 });
            let disturbance = number(2.0);
            let bounds = [-3.0, 2.5];
            if !program.solve(&start, disturbance, &stages, bounds, 40) {
                unsettled += 1;
                assert!(program.inputs.iter().all(|u| (bounds[0]..=bounds[1]).contains(u)));
                continue;
            }
            let (hessian, gradient) = dense(&program, &start, disturbance, &stages);
            let inputs = DVector::from_vec(program.inputs.clone());
            let slope = &hessian * &inputs + gradient;
            let scale = hessian.amax();
            for (u, slope) in inputs.iter().zip(slope.iter()) {
                let slope = slope / scale;
                if *u <= bounds[0] {
                    assert!(slope > -1e-9, "round {round}: {slope} at the lower bound");
                } else if *u >= bounds[1] {
                    assert!(slope < 1e-9, "round {round}: {slope} at the upper bound");
                } else {
                    assert!(slope.abs() < 1e-9, "round {round}: {slope} at {u}");
                }
                held += usize::from(*u <= bounds[0] || *u >= bounds[1]);
            }
        }
        assert!(held > 300, "{held} inputs at a bound");
        assert!(unsettled <= 4, "{unsettled} of 200 not settled");
    }
}
