//! The derivative of a pass, by hand: every function here is the adjoint of one in `pass.rs`, in reverse order.

use super::architecture::INPUTS;
use super::conv::{Packed, Start, weights_gradient};
use super::pass::{DAMPING, MIN_CURVATURE, PackedNetwork, Pass, halves, input, is_closed};
use super::real::Real;
use super::response::Response;
use super::tile_problem::{Scratch, TileProblem};

/// The adjoint convolutions, and room for the derivatives by what lies between the layers.
#[derive(Debug, Clone)]
pub(crate) struct Adjoint<T> {
    features_layer: Packed<T>,
    hidden_layers: Vec<Packed<T>>,
    output_layer: Packed<T>,
    linear: Vec<Packed<T>>,
    step: Vec<T>,
    hidden: [Vec<T>; 2],
    inputs: Vec<T>,
    cells: Vec<T>,
}

impl<T: Real> Adjoint<T> {
    pub(crate) fn new(network: &PackedNetwork<T>, problem: &TileProblem<T>) -> Self {
        let (p, layout, architecture) = (&network.parameters, &network.layout, &network.architecture);
        let c = architecture.channels;
        let cells = &problem.cells;
        Self {
            features_layer: Packed::adjoint(&p[layout.features_layer.clone()], INPUTS, c),
            hidden_layers: layout
                .hidden_layers
                .iter()
                .map(|(weights, _)| Packed::adjoint(&p[weights.clone()], c, c))
                .collect(),
            output_layer: Packed::adjoint(&p[layout.output_layer.clone()], c, 1),
            linear: (0..architecture.stages)
                .map(|stage| Packed::adjoint(&p[architecture.linear_of(layout, stage)], INPUTS, 1))
                .collect(),
            step: cells.planes(1),
            hidden: [cells.planes(c), cells.planes(c)],
            inputs: cells.planes(INPUTS),
            cells: cells.planes(1),
        }
    }

    /// From the derivatives by `paint` and `last_step` after a pass to those before it, in place. `ink_gradient`: derivative
    /// of the loss by the ink that the pass rendered, over whole pixel planes; it is overwritten. `gradient` is added to.
    pub(crate) fn pass(
        &mut self,
        (problem, network, stage): (&TileProblem<T>, &PackedNetwork<T>, usize),
        pass: &Pass<T>,
        (paint, last_step): (&mut [T], &mut [T]),
        ink_gradient: &mut [T],
        gradient: &mut [T],
        scratch: &mut Scratch<T>,
    ) {
        self.update(problem, pass, paint, last_step);
        self.predict(problem, network, stage, pass, gradient);
        self.features(problem, pass, paint, last_step, ink_gradient, scratch);
        self.render(problem, pass, paint, ink_gradient, scratch);
    }

    fn update(&mut self, problem: &TileProblem<T>, pass: &Pass<T>, paint: &mut [T], last_step: &mut [T]) {
        let cells = &problem.cells;
        let zero = T::default();
        for y in 0..cells.height {
            for k in cells.at(0, y)..cells.at(cells.width, y) {
                let before = pass.inputs[input::PAINT * cells.plane() + k];
                let after = before + pass.step[k];
                let both = paint[k] + last_step[k];
                if is_closed(before, pass.inputs[k]) {
                    // after = before: the step was nothing.
                    self.step[k] = zero;
                } else if after > zero && after < problem.upper_bounds[k] {
                    self.step[k] = both;
                    paint[k] = both - last_step[k];
                } else {
                    self.step[k] = zero;
                    paint[k] = -last_step[k];
                }
            }
        }
    }

    fn predict(
        &mut self,
        problem: &TileProblem<T>,
        network: &PackedNetwork<T>,
        stage: usize,
        pass: &Pass<T>,
        gradient: &mut [T],
    ) {
        let (cells, layout, architecture) = (&problem.cells, &network.layout, &network.architecture);
        let c = architecture.channels;
        let zeros = vec![T::default(); c.max(INPUTS)];
        let stage = stage.min(architecture.stages - 1);
        gradient[layout.output_bias] += sum(problem, &self.step, 0);
        weights_gradient(
            cells,
            (&pass.inputs, INPUTS),
            (&self.step, 1),
            &mut gradient[architecture.linear_of(layout, stage)],
        );
        weights_gradient(
            cells,
            (&pass.hidden[architecture.layers - 1], c),
            (&self.step, 1),
            &mut gradient[layout.output_layer.clone()],
        );
        let start = Start::Bias(zeros.as_slice());
        self.linear[stage].apply(cells, &self.step, &mut self.inputs, start, false);
        self.output_layer.apply(cells, &self.step, &mut self.hidden[0], start, false);
        for layer in (0..architecture.layers).rev() {
            for (up, &value) in self.hidden[0].iter_mut().zip(&pass.hidden[layer]) {
                *up = if value > T::default() { *up } else { T::default() };
            }
            let (bias, weights) = match layer.checked_sub(1) {
                Some(k) => (layout.hidden_layers[k].1.clone(), layout.hidden_layers[k].0.clone()),
                None => (architecture.bias_of(layout, stage), layout.features_layer.clone()),
            };
            for k in 0..c {
                let total = sum(problem, &self.hidden[0], k);
                gradient[bias.start + k] += total;
                if layer == 0 {
                    for (s, &setting) in problem.conditioning.iter().enumerate() {
                        gradient[layout.conditioning.start + k * problem.conditioning.len() + s] += setting * total;
                    }
                }
            }
            let (below, ins) = match layer.checked_sub(1) {
                Some(k) => (&pass.hidden[k], c),
                None => (&pass.inputs, INPUTS),
            };
            weights_gradient(cells, (below, ins), (&self.hidden[0], c), &mut gradient[weights]);
            if let Some(k) = layer.checked_sub(1) {
                let (up, down) = self.hidden.split_at_mut(1);
                self.hidden_layers[k].apply(cells, &up[0], &mut down[0], start, false);
                self.hidden.swap(0, 1);
            } else {
                self.features_layer.apply(cells, &self.hidden[0], &mut self.inputs, Start::Output, false);
            }
        }
    }

    fn features(
        &mut self,
        problem: &TileProblem<T>,
        pass: &Pass<T>,
        paint: &mut [T],
        last_step: &mut [T],
        ink_gradient: &mut [T],
        scratch: &mut Scratch<T>,
    ) {
        let (cells, pixels) = (&problem.cells, &problem.pixels);
        let plane = cells.plane();
        for y in 0..cells.height {
            for k in cells.at(0, y)..cells.at(cells.width, y) {
                paint[k] += self.inputs[input::PAINT * plane + k];
                last_step[k] = self.inputs[input::LAST_STEP * plane + k];
                // q = g / (W + softest)
                let curvature = pass.inputs[input::CURVATURE * plane + k] + T::of(MIN_CURVATURE);
                let by_pull = self.inputs[k] / curvature;
                self.inputs[k] = by_pull;
                self.inputs[input::CURVATURE * plane + k] += -(by_pull * pass.inputs[k]);
            }
        }
        let (weighted_residual, rest) = scratch.pixels.split_at_mut(pixels.plane());
        let (curvature_term, missing) = rest.split_at_mut(pixels.plane());
        let (along, down) = problem.footprint.stride();
        let share = T::of(1.0 / (along * down) as f64);
        // The mean is the adjoint of the deposit over the pixels per cell; so is its adjoint.
        problem.footprint.deposit(cells, &self.inputs, pixels, weighted_residual, &mut scratch.phases);
        self.cells.copy_from_slice(&self.inputs[input::CURVATURE * plane..][..plane]);
        problem.footprint.deposit(cells, &self.cells, pixels, curvature_term, &mut scratch.phases);
        quadrant_means_adjoint(problem, &self.inputs, missing);
        let damping = T::of(DAMPING);
        for y in 0..pixels.height {
            for k in pixels.at(0, y)..pixels.at(pixels.width, y) {
                let (a, w, weight) = (pass.ink[k], pass.slope[k], problem.weight[k]);
                let r = problem.wanted[k] - a;
                let (weighted_residual, curvature_term, missing) =
                    (share * weighted_residual[k], share * curvature_term[k], missing[k]);
                let below = w * w + damping;
                let by_residual = weight * w * (weighted_residual + missing / below);
                let by_slope = weight
                    * (r * weighted_residual
                        + T::of(2.0) * w * curvature_term
                        + missing * r * (damping - w * w) / (below * below));
                ink_gradient[k] += by_slope * slope_by_ink(&problem.response, a) - by_residual;
            }
        }
    }

    fn render(
        &mut self,
        problem: &TileProblem<T>,
        pass: &Pass<T>,
        paint: &mut [T],
        ink_gradient: &mut [T],
        scratch: &mut Scratch<T>,
    ) {
        add_by_paint(problem, pass, paint, ink_gradient, &mut self.cells, scratch);
    }
}

/// Adds to `paint` the derivative through the ink: `Gᵀ (w · ink_gradient)`.
pub(crate) fn add_by_paint<T: Real>(
    problem: &TileProblem<T>,
    pass: &Pass<T>,
    paint: &mut [T],
    ink_gradient: &mut [T],
    cells_scratch: &mut [T],
    scratch: &mut Scratch<T>,
) {
    let (cells, pixels) = (&problem.cells, &problem.pixels);
    for (up, &w) in ink_gradient.iter_mut().zip(&pass.slope) {
        *up = *up * w;
    }
    problem.footprint.mean(cells, cells_scratch, 0, pixels, ink_gradient, &mut scratch.phases);
    let (along, down) = problem.footprint.stride();
    let gain = T::of((along * down) as f64);
    for y in 0..cells.height {
        for k in cells.at(0, y)..cells.at(cells.width, y) {
            paint[k] += gain * cells_scratch[k];
        }
    }
}

/// How the slope of the response changes with its ink.
fn slope_by_ink<T: Real>(response: &Response, ink: T) -> T {
    match response {
        // 1 - a²
        Response::Tanh => T::of(-2.0) * ink,
        // Training is done on tanh; a table is only painted with, and its slope taken as constant.
        Response::Table(_) => T::default(),
    }
}

/// Sum over the cells of one plane.
fn sum<T: Real>(problem: &TileProblem<T>, planes: &[T], k: usize) -> T {
    let cells = &problem.cells;
    (0..cells.height)
        .fold(T::default(), |total, y| total + cells.row(planes, k, y).iter().fold(T::default(), |row, &v| row + v))
}

/// Adjoint of the means over quadrants.
fn quadrant_means_adjoint<T: Real>(problem: &TileProblem<T>, inputs: &[T], to: &mut [T]) {
    let (cells, pixels, (along, down)) = (&problem.cells, &problem.pixels, problem.footprint.stride());
    let ((lefts, wide), (tops, high)) = (halves(along), halves(down));
    let share = T::of(1.0 / (wide * high) as f64);
    to.fill(T::default());
    for (quadrant, (dy, dx)) in tops.iter().flat_map(|&t| lefts.iter().map(move |&l| (t, l))).enumerate() {
        for j in 0..cells.height {
            let up = cells.row(inputs, input::QUADRANTS + quadrant, j);
            for y in (j * down + dy..j * down + dy + high).take_while(|&y| y < pixels.height) {
                let row = pixels.row_mut(to, 0, y);
                for x in dx..dx + wide {
                    for (o, &v) in row.iter_mut().skip(x).step_by(along).zip(up) {
                        *o += share * v;
                    }
                }
            }
        }
    }
}
