use super::adjoint::{Adjoint, add_by_paint};
use super::field::{Field, Scratch};
use super::pass::{Block, Pass};
use super::real::Real;

/// Floor of the error in the loss: a picture that is right to 30 dB is worth little more work.
const FLOOR: f64 = 1e-3;

/// A painting with everything on the way remembered, to be differentiated.
#[derive(Debug, Clone)]
pub(crate) struct Trace<T> {
    passes: Vec<Pass<T>>,
    paint: Vec<T>,
    last_step: Vec<T>,
    scratch: Scratch<T>,
}

impl<T: Real> Trace<T> {
    pub(crate) fn new(field: &Field<T>, block: &Block<T>, passes: usize) -> Self {
        Self {
            passes: vec![Pass::new(field, &block.shape()); passes + 1],
            paint: field.cells.planes(1),
            last_step: field.cells.planes(1),
            scratch: Scratch::new(field),
        }
    }

    /// Paints; `disturb(pass, paint)` may change the paint between passes and leaves its derivative as it is.
    pub(crate) fn forward(&mut self, field: &Field<T>, block: &Block<T>, disturb: &mut dyn FnMut(usize, &mut [T])) {
        self.paint.fill(T::default());
        self.last_step.fill(T::default());
        let last = self.passes.len() - 1;
        for (stage, pass) in self.passes.iter_mut().enumerate() {
            pass.look(field, &self.paint, &mut self.scratch);
            if stage < last {
                pass.sense(field, &self.paint, &self.last_step, &mut self.scratch);
                pass.think(field, block, stage);
                pass.act(field, &mut self.paint, &mut self.last_step);
                disturb(stage, &mut self.paint);
            }
        }
    }

    /// Mean squared error of the ink after each number of passes, from 0.
    pub(crate) fn errors(&self, field: &Field<T>) -> Vec<f64> {
        self.passes.iter().map(|pass| mean_squared(field, pass)).collect()
    }

    /// The loss `Σ_k share_k ln(mse_k + floor)` after `k = 1..` passes; adds its derivative to `gradient`.
    pub(crate) fn backward(
        &mut self,
        field: &Field<T>,
        block: &Block<T>,
        shares: &[f64],
        adjoint: &mut Adjoint<T>,
        gradient: &mut [T],
    ) -> f64 {
        let mut by_ink = field.pixels.planes(1);
        let mut cells_scratch = field.cells.planes(1);
        let (paint, last_step) = (&mut self.paint, &mut self.last_step);
        paint.fill(T::default());
        last_step.fill(T::default());
        let mut loss = 0.0;
        for stage in (1..self.passes.len()).rev() {
            let pass = &self.passes[stage];
            loss += shares[stage - 1] * add_loss(field, pass, shares[stage - 1], &mut by_ink);
            if stage + 1 == self.passes.len() {
                add_by_paint(field, pass, paint, &mut by_ink, &mut cells_scratch, &mut self.scratch);
            } else {
                let at = (field, block, stage);
                adjoint.pass(at, pass, (paint, last_step), &mut by_ink, gradient, &mut self.scratch);
            }
        }
        // The first pass looks at the bare wall: what lies before it does not matter.
        by_ink.fill(T::default());
        adjoint.pass((field, block, 0), &self.passes[0], (paint, last_step), &mut by_ink, gradient, &mut self.scratch);
        loss
    }
}

fn mean_squared<T: Real>(field: &Field<T>, pass: &Pass<T>) -> f64 {
    let pixels = &field.pixels;
    let (mut sum, mut weights) = (0.0, 0.0);
    for y in 0..pixels.height {
        for k in pixels.at(0, y)..pixels.at(pixels.width, y) {
            let weight = field.weight[k].wide();
            sum += weight * (field.wanted[k] - pass.ink[k]).wide().powi(2);
            weights += weight;
        }
    }
    sum / weights
}

/// `ln(mse + floor)`; `by_ink` becomes its derivative times `share`.
fn add_loss<T: Real>(field: &Field<T>, pass: &Pass<T>, share: f64, by_ink: &mut [T]) -> f64 {
    let pixels = &field.pixels;
    let error = mean_squared(field, pass);
    let weights: f64 = (0..pixels.height).flat_map(|y| pixels.row(&field.weight, 0, y)).map(|w| w.wide()).sum();
    let factor = T::of(-2.0 * share / (weights * (error + FLOOR)));
    by_ink.fill(T::default());
    for y in 0..pixels.height {
        let at = pixels.at(0, y)..pixels.at(pixels.width, y);
        let inks = field.wanted[at.clone()].iter().zip(&pass.ink[at.clone()]);
        for ((up, &weight), (&wanted, &ink)) in by_ink[at.clone()].iter_mut().zip(&field.weight[at]).zip(inks) {
            *up = factor * weight * (wanted - ink);
        }
    }
    (error + FLOOR).ln()
}

#[cfg(test)]
mod tests {
    use super::super::{Law, Shape, Spread};
    use super::*;
    use crate::kernel::SprayKernel;
    use crate::procedural::{Texture, lattice};

    fn field(size: usize, stride: (usize, usize)) -> Field<f64> {
        let kernel = SprayKernel::new(2.0, 2.0).unwrap();
        let first = ((stride.0 - 1) / 2, (stride.1 - 1) / 2);
        let cells = ((size - first.0).div_ceil(stride.0), (size - first.1).div_ceil(stride.1));
        let spread = Spread::new(kernel.taps(), stride, first);
        let mut field = Field::new(cells, (size, size), spread, Law::Tanh);
        let wanted = Texture::Worley.image(3, size);
        for y in 0..size {
            for x in 0..size {
                let k = field.pixels.at(x, y);
                field.wanted[k] = wanted.at(x, y);
                field.before[k] = 0.2 * lattice(5, x as i64, y as i64);
                field.weight[k] = 0.5 + lattice(6, x as i64, y as i64);
            }
        }
        field.top.fill(0.9);
        field
    }

    #[test]
    fn derivatives_match_central_differences() {
        for stride in [(2, 2), (2, 3)] {
            let field = field(21, stride);
            let shape = Shape { channels: 3, layers: 2, stages: 2 };
            let parameters: Vec<f64> = (0..shape.parameters()).map(|k| 0.5 * (lattice(9, k as i64, 0) - 0.4)).collect();
            let shares = [0.3, 0.1, 1.0];
            let loss = |parameters: &[f64]| {
                let block = Block::new(shape, parameters.to_vec());
                let mut trace = Trace::new(&field, &block, 3);
                trace.forward(&field, &block, &mut |_, _| ());
                trace.errors(&field)[1..].iter().zip(shares).map(|(e, s)| s * (e + FLOOR).ln()).sum::<f64>()
            };
            let block = Block::new(shape, parameters.clone());
            let mut trace = Trace::new(&field, &block, 3);
            trace.forward(&field, &block, &mut |_, _| ());
            let mut gradient = vec![0.0; parameters.len()];
            let value = trace.backward(&field, &block, &shares, &mut Adjoint::new(&block, &field), &mut gradient);
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
