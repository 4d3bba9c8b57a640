//! The derivative of a pass, by hand: every function here is the adjoint of one in `pass.rs`, in reverse order.

use super::conv::{Packed, Start, weights_gradient};
use super::field::{Field, Scratch};
use super::law::Law;
use super::pass::{Block, DAMPING, Pass, SOFTEST, halves, input, is_closed};
use super::real::Real;
use super::shape::INPUTS;

/// The adjoint convolutions, and room for the derivatives by what lies between the layers.
#[derive(Debug, Clone)]
pub(crate) struct Adjoint<T> {
    sense: Packed<T>,
    think: Vec<Packed<T>>,
    act: Packed<T>,
    linear: Vec<Packed<T>>,
    step: Vec<T>,
    hidden: [Vec<T>; 2],
    inputs: Vec<T>,
    cells: Vec<T>,
}

impl<T: Real> Adjoint<T> {
    pub(crate) fn new(block: &Block<T>, field: &Field<T>) -> Self {
        let (p, layout, shape) = (&block.parameters, &block.layout, &block.shape);
        let c = shape.channels;
        let cells = &field.cells;
        Self {
            sense: Packed::adjoint(&p[layout.sense.clone()], INPUTS, c),
            think: layout.think.iter().map(|(weights, _)| Packed::adjoint(&p[weights.clone()], c, c)).collect(),
            act: Packed::adjoint(&p[layout.act.clone()], c, 1),
            linear: (0..shape.stages)
                .map(|stage| Packed::adjoint(&p[shape.linear_of(layout, stage)], INPUTS, 1))
                .collect(),
            step: cells.planes(1),
            hidden: [cells.planes(c), cells.planes(c)],
            inputs: cells.planes(INPUTS),
            cells: cells.planes(1),
        }
    }

    /// From the derivatives by `paint` and `last_step` after a pass to those before it, in place. `ink_gradient`: derivative
    /// of the loss by the ink that the pass looked at, over whole pixel planes; it is overwritten. `gradient` is added to.
    pub(crate) fn pass(
        &mut self,
        (field, block, stage): (&Field<T>, &Block<T>, usize),
        pass: &Pass<T>,
        (paint, last_step): (&mut [T], &mut [T]),
        ink_gradient: &mut [T],
        gradient: &mut [T],
        scratch: &mut Scratch<T>,
    ) {
        self.act(field, pass, paint, last_step);
        self.think(field, block, stage, pass, gradient);
        self.sense(field, pass, paint, last_step, ink_gradient, scratch);
        self.look(field, pass, paint, ink_gradient, scratch);
    }

    fn act(&mut self, field: &Field<T>, pass: &Pass<T>, paint: &mut [T], last_step: &mut [T]) {
        let cells = &field.cells;
        let zero = T::default();
        for y in 0..cells.height {
            for k in cells.at(0, y)..cells.at(cells.width, y) {
                let before = pass.inputs[input::PAINT * cells.plane() + k];
                let after = before + pass.step[k];
                let both = paint[k] + last_step[k];
                if is_closed(before, pass.inputs[k]) {
                    // after = before: the step was nothing.
                    self.step[k] = zero;
                } else if after > zero && after < field.top[k] {
                    self.step[k] = both;
                    paint[k] = both - last_step[k];
                } else {
                    self.step[k] = zero;
                    paint[k] = -last_step[k];
                }
            }
        }
    }

    fn think(&mut self, field: &Field<T>, block: &Block<T>, stage: usize, pass: &Pass<T>, gradient: &mut [T]) {
        let (cells, layout, shape) = (&field.cells, &block.layout, &block.shape);
        let c = shape.channels;
        let zeros = vec![T::default(); c.max(INPUTS)];
        let stage = stage.min(shape.stages - 1);
        gradient[layout.act_bias] += sum(field, &self.step, 0);
        weights_gradient(cells, (&pass.inputs, INPUTS), (&self.step, 1), &mut gradient[shape.linear_of(layout, stage)]);
        weights_gradient(
            cells,
            (&pass.hidden[shape.layers - 1], c),
            (&self.step, 1),
            &mut gradient[layout.act.clone()],
        );
        let start = Start::Bias(zeros.as_slice());
        self.linear[stage].apply(cells, &self.step, &mut self.inputs, start, false);
        self.act.apply(cells, &self.step, &mut self.hidden[0], start, false);
        for layer in (0..shape.layers).rev() {
            for (up, &value) in self.hidden[0].iter_mut().zip(&pass.hidden[layer]) {
                *up = if value > T::default() { *up } else { T::default() };
            }
            let (bias, weights) = match layer.checked_sub(1) {
                Some(k) => (layout.think[k].1.clone(), layout.think[k].0.clone()),
                None => (shape.bias_of(layout, stage), layout.sense.clone()),
            };
            for k in 0..c {
                let total = sum(field, &self.hidden[0], k);
                gradient[bias.start + k] += total;
                if layer == 0 {
                    for (s, &setting) in field.settings.iter().enumerate() {
                        gradient[layout.settings.start + k * field.settings.len() + s] += setting * total;
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
                self.think[k].apply(cells, &up[0], &mut down[0], start, false);
                self.hidden.swap(0, 1);
            } else {
                self.sense.apply(cells, &self.hidden[0], &mut self.inputs, Start::Output, false);
            }
        }
    }

    fn sense(
        &mut self,
        field: &Field<T>,
        pass: &Pass<T>,
        paint: &mut [T],
        last_step: &mut [T],
        ink_gradient: &mut [T],
        scratch: &mut Scratch<T>,
    ) {
        let (cells, pixels) = (&field.cells, &field.pixels);
        let plane = cells.plane();
        for y in 0..cells.height {
            for k in cells.at(0, y)..cells.at(cells.width, y) {
                paint[k] += self.inputs[input::PAINT * plane + k];
                last_step[k] = self.inputs[input::LAST_STEP * plane + k];
                // q = g / (W + softest)
                let stiffness = pass.inputs[input::STIFFNESS * plane + k] + T::of(SOFTEST);
                let by_pull = self.inputs[k] / stiffness;
                self.inputs[k] = by_pull;
                self.inputs[input::STIFFNESS * plane + k] += -(by_pull * pass.inputs[k]);
            }
        }
        let (pull, rest) = scratch.pixels.split_at_mut(pixels.plane());
        let (stiff, missing) = rest.split_at_mut(pixels.plane());
        let (along, down) = field.spread.stride();
        let share = T::of(1.0 / (along * down) as f64);
        // The mean is the adjoint of the spread over the pixels per cell; so is its adjoint.
        field.spread.spread(cells, &self.inputs, pixels, pull, &mut scratch.spread);
        self.cells.copy_from_slice(&self.inputs[input::STIFFNESS * plane..][..plane]);
        field.spread.spread(cells, &self.cells, pixels, stiff, &mut scratch.spread);
        unquarter(field, &self.inputs, missing);
        let damping = T::of(DAMPING);
        for y in 0..pixels.height {
            for k in pixels.at(0, y)..pixels.at(pixels.width, y) {
                let (a, w, weight) = (pass.ink[k], pass.slope[k], field.weight[k]);
                let r = field.wanted[k] - a;
                let (pull, stiff, missing) = (share * pull[k], share * stiff[k], missing[k]);
                let below = w * w + damping;
                let by_residual = weight * w * (pull + missing / below);
                let by_slope =
                    weight * (r * pull + T::of(2.0) * w * stiff + missing * r * (damping - w * w) / (below * below));
                ink_gradient[k] += by_slope * slope_by_ink(&field.law, a) - by_residual;
            }
        }
    }

    fn look(
        &mut self,
        field: &Field<T>,
        pass: &Pass<T>,
        paint: &mut [T],
        ink_gradient: &mut [T],
        scratch: &mut Scratch<T>,
    ) {
        add_by_paint(field, pass, paint, ink_gradient, &mut self.cells, scratch);
    }
}

/// Adds to `paint` the derivative through the ink: `Gᵀ (w · ink_gradient)`.
pub(crate) fn add_by_paint<T: Real>(
    field: &Field<T>,
    pass: &Pass<T>,
    paint: &mut [T],
    ink_gradient: &mut [T],
    cells_scratch: &mut [T],
    scratch: &mut Scratch<T>,
) {
    let (cells, pixels) = (&field.cells, &field.pixels);
    for (up, &w) in ink_gradient.iter_mut().zip(&pass.slope) {
        *up = *up * w;
    }
    field.spread.mean(cells, cells_scratch, 0, pixels, ink_gradient, &mut scratch.spread);
    let (along, down) = field.spread.stride();
    let gain = T::of((along * down) as f64);
    for y in 0..cells.height {
        for k in cells.at(0, y)..cells.at(cells.width, y) {
            paint[k] += gain * cells_scratch[k];
        }
    }
}

/// How the slope of the law changes with its ink.
fn slope_by_ink<T: Real>(law: &Law, ink: T) -> T {
    match law {
        // 1 - a²
        Law::Tanh => T::of(-2.0) * ink,
        // Training is done on tanh; a table is only painted with, and its slope taken as constant.
        Law::Table(_) => T::default(),
    }
}

/// Sum over the cells of one plane.
fn sum<T: Real>(field: &Field<T>, planes: &[T], k: usize) -> T {
    let cells = &field.cells;
    (0..cells.height)
        .fold(T::default(), |total, y| total + cells.row(planes, k, y).iter().fold(T::default(), |row, &v| row + v))
}

/// Adjoint of the means over quarters.
fn unquarter<T: Real>(field: &Field<T>, inputs: &[T], to: &mut [T]) {
    let (cells, pixels, (along, down)) = (&field.cells, &field.pixels, field.spread.stride());
    let ((lefts, wide), (tops, high)) = (halves(along), halves(down));
    let share = T::of(1.0 / (wide * high) as f64);
    to.fill(T::default());
    for (quarter, (dy, dx)) in tops.iter().flat_map(|&t| lefts.iter().map(move |&l| (t, l))).enumerate() {
        for j in 0..cells.height {
            let up = cells.row(inputs, input::QUARTERS + quarter, j);
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
