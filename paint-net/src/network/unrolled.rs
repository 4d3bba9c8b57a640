//! The unrolled network: all passes remembered, for backpropagation through them.

use super::adjoint::{Adjoint, add_by_paint};
use super::pass::{PackedNetwork, Pass};
use super::real::Real;
use super::tile_problem::{Scratch, TileProblem};

/// Floor of the error in the loss: a picture that is right to 30 dB is worth little more work.
const FLOOR: f64 = 1e-3;

/// The passes over a problem with everything on the way remembered, to be differentiated.
#[derive(Debug, Clone)]
pub(crate) struct Unrolled<T> {
    passes: Vec<Pass<T>>,
    paint: Vec<T>,
    last_step: Vec<T>,
    scratch: Scratch<T>,
}

impl<T: Real> Unrolled<T> {
    pub(crate) fn new(problem: &TileProblem<T>, network: &PackedNetwork<T>, passes: usize) -> Self {
        Self {
            passes: vec![Pass::new(problem, &network.architecture()); passes + 1],
            paint: problem.cells.planes(1),
            last_step: problem.cells.planes(1),
            scratch: Scratch::new(problem),
        }
    }

    /// Paints; `perturb(pass, paint)` may change the paint between passes and leaves its derivative as it is.
    pub(crate) fn forward(
        &mut self,
        problem: &TileProblem<T>,
        network: &PackedNetwork<T>,
        perturb: &mut dyn FnMut(usize, &mut [T]),
    ) {
        self.paint.fill(T::default());
        self.last_step.fill(T::default());
        let last = self.passes.len() - 1;
        for (stage, pass) in self.passes.iter_mut().enumerate() {
            pass.render(problem, &self.paint, &mut self.scratch);
            if stage < last {
                pass.features(problem, &self.paint, &self.last_step, &mut self.scratch);
                pass.predict(problem, network, stage);
                pass.update(problem, &mut self.paint, &mut self.last_step);
                perturb(stage, &mut self.paint);
            }
        }
    }

    /// Mean squared error of the ink after each number of passes, from 0.
    pub(crate) fn errors(&self, problem: &TileProblem<T>) -> Vec<f64> {
        self.passes.iter().map(|pass| mean_squared(problem, pass)).collect()
    }

    /// The loss `Σ_k share_k ln(mse_k + floor)` after `k = 1..` passes; adds its derivative to `gradient`.
    pub(crate) fn backward(
        &mut self,
        problem: &TileProblem<T>,
        network: &PackedNetwork<T>,
        shares: &[f64],
        adjoint: &mut Adjoint<T>,
        gradient: &mut [T],
    ) -> f64 {
        let mut by_ink = problem.pixels.planes(1);
        let mut cells_scratch = problem.cells.planes(1);
        let (paint, last_step) = (&mut self.paint, &mut self.last_step);
        paint.fill(T::default());
        last_step.fill(T::default());
        let mut loss = 0.0;
        for stage in (1..self.passes.len()).rev() {
            let pass = &self.passes[stage];
            loss += shares[stage - 1] * add_loss(problem, pass, shares[stage - 1], &mut by_ink);
            if stage + 1 == self.passes.len() {
                add_by_paint(problem, pass, paint, &mut by_ink, &mut cells_scratch, &mut self.scratch);
            } else {
                let at = (problem, network, stage);
                adjoint.pass(at, pass, (paint, last_step), &mut by_ink, gradient, &mut self.scratch);
            }
        }
        // The first pass renders the bare wall: what lies before it does not matter.
        by_ink.fill(T::default());
        adjoint.pass(
            (problem, network, 0),
            &self.passes[0],
            (paint, last_step),
            &mut by_ink,
            gradient,
            &mut self.scratch,
        );
        loss
    }
}

fn mean_squared<T: Real>(problem: &TileProblem<T>, pass: &Pass<T>) -> f64 {
    let pixels = &problem.pixels;
    let (mut sum, mut weights) = (0.0, 0.0);
    for y in 0..pixels.height {
        for k in pixels.at(0, y)..pixels.at(pixels.width, y) {
            let weight = problem.weight[k].to_f64();
            sum += weight * (problem.wanted[k] - pass.ink[k]).to_f64().powi(2);
            weights += weight;
        }
    }
    sum / weights
}

/// `ln(mse + floor)`; `by_ink` becomes its derivative times `share`.
fn add_loss<T: Real>(problem: &TileProblem<T>, pass: &Pass<T>, share: f64, by_ink: &mut [T]) -> f64 {
    let pixels = &problem.pixels;
    let error = mean_squared(problem, pass);
    let weights: f64 = (0..pixels.height).flat_map(|y| pixels.row(&problem.weight, 0, y)).map(|w| w.to_f64()).sum();
    let factor = T::of(-2.0 * share / (weights * (error + FLOOR)));
    by_ink.fill(T::default());
    for y in 0..pixels.height {
        let at = pixels.at(0, y)..pixels.at(pixels.width, y);
        let inks = problem.wanted[at.clone()].iter().zip(&pass.ink[at.clone()]);
        for ((up, &weight), (&wanted, &ink)) in by_ink[at.clone()].iter_mut().zip(&problem.weight[at]).zip(inks) {
            *up = factor * weight * (wanted - ink);
        }
    }
    (error + FLOOR).ln()
}

#[cfg(test)]
mod tests {
    use super::super::architecture::Architecture;
    use super::super::footprint_operator::FootprintOperator;
    use super::super::response::Response;
    use super::*;
    use crate::model::SprayKernel;
    use crate::procedural::{Texture, lattice};

    fn problem(size: usize, stride: (usize, usize)) -> TileProblem<f64> {
        let kernel = SprayKernel::new(2.0, 2.0).unwrap();
        let first = ((stride.0 - 1) / 2, (stride.1 - 1) / 2);
        let cells = ((size - first.0).div_ceil(stride.0), (size - first.1).div_ceil(stride.1));
        let footprint = FootprintOperator::new(kernel.taps(), stride, first);
        let mut problem = TileProblem::new(cells, (size, size), footprint, Response::Tanh);
        let wanted = Texture::Worley.image(3, size);
        for y in 0..size {
            for x in 0..size {
                let k = problem.pixels.at(x, y);
                problem.wanted[k] = wanted.at(x, y);
                problem.before[k] = 0.2 * lattice(5, x as i64, y as i64);
                problem.weight[k] = 0.5 + lattice(6, x as i64, y as i64);
            }
        }
        problem.upper_bounds.fill(0.9);
        problem
    }

    #[test]
    fn derivatives_match_central_differences() {
        for stride in [(2, 2), (2, 3)] {
            let problem = problem(21, stride);
            let architecture = Architecture { channels: 3, layers: 2, stages: 2 };
            let parameters: Vec<f64> =
                (0..architecture.parameters()).map(|k| 0.5 * (lattice(9, k as i64, 0) - 0.4)).collect();
            let shares = [0.3, 0.1, 1.0];
            let loss = |parameters: &[f64]| {
                let network = PackedNetwork::new(architecture, parameters.to_vec());
                let mut trace = Unrolled::new(&problem, &network, 3);
                trace.forward(&problem, &network, &mut |_, _| ());
                trace.errors(&problem)[1..].iter().zip(shares).map(|(e, s)| s * (e + FLOOR).ln()).sum::<f64>()
            };
            let network = PackedNetwork::new(architecture, parameters.clone());
            let mut trace = Unrolled::new(&problem, &network, 3);
            trace.forward(&problem, &network, &mut |_, _| ());
            let mut gradient = vec![0.0; parameters.len()];
            let value =
                trace.backward(&problem, &network, &shares, &mut Adjoint::new(&network, &problem), &mut gradient);
            assert!((value - loss(&parameters)).abs() < 1e-12);
            let scale = gradient.iter().fold(0.0_f64, |m, g| m.max(g.abs()));
            assert!(scale > 1e-3);
            for k in 0..parameters.len() {
                let mut moved = parameters.clone();
                moved[k] += 1e-6;
                let up = loss(&moved);
                moved[k] -= 2e-6;
                let difference = (up - loss(&moved)) / 2e-6;
                assert!(
                    (difference - gradient[k]).abs() < 1e-6 * scale.max(1.0),
                    "parameter {k}: {} against {difference}",
                    gradient[k]
                );
            }
        }
    }
}
