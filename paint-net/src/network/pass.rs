use super::conv::{Packed, Start};
use super::field::{Field, Scratch};
use super::planes::{BLOCK, Grid};
use super::real::Real;
use super::shape::{INPUTS, Layout, Shape};

/// Damping of the missing depth `r w / (w² + damping)` of a pixel: where ink is saturated, no depth is missing.
pub(super) const DAMPING: f64 = 0.05;
/// Least stiffness of a cell.
pub(super) const SOFTEST: f64 = 1e-3;

/// The weights, ordered for the inner loops.
#[derive(Debug, Clone)]
pub(crate) struct Block<T> {
    pub(super) shape: Shape,
    pub(super) layout: Layout,
    pub(super) parameters: Vec<T>,
    sense: Packed<T>,
    think: Vec<Packed<T>>,
    act: Packed<T>,
    linear: Vec<Packed<T>>,
}

impl<T: Real> Block<T> {
    pub(crate) fn new(shape: Shape, parameters: Vec<T>) -> Self {
        let layout = shape.layout();
        let (p, c) = (&parameters, shape.channels);
        Self {
            sense: Packed::new(&p[layout.sense.clone()], INPUTS, c),
            think: layout.think.iter().map(|(weights, _)| Packed::new(&p[weights.clone()], c, c)).collect(),
            act: Packed::new(&p[layout.act.clone()], c, 1),
            linear: (0..shape.stages)
                .map(|stage| Packed::new(&p[shape.linear_of(&layout, stage)], INPUTS, 1))
                .collect(),
            shape,
            layout,
            parameters,
        }
    }

    pub(crate) fn shape(&self) -> Shape {
        self.shape
    }

    #[cfg(feature = "train")]
    pub(crate) fn parameters(&self) -> &[T] {
        &self.parameters
    }

    /// Bias of the first layer: of the stage and of the nozzle.
    fn sense_bias(&self, stage: usize, settings: &[T; 2]) -> Vec<T> {
        let own = &self.parameters[self.shape.bias_of(&self.layout, stage)];
        let by_setting = self.parameters[self.layout.settings.clone()].chunks_exact(settings.len());
        own.iter().zip(by_setting).map(|(&b, u)| b + u[0] * settings[0] + u[1] * settings[1]).collect()
    }
}

/// One look at the canvas and what is done about it: everything computed on the way, so that it can be differentiated.
#[derive(Debug, Clone)]
pub(crate) struct Pass<T> {
    /// Ink and slope of the law, as the canvas is before the pass.
    pub(crate) ink: Vec<T>,
    pub(crate) slope: Vec<T>,
    /// `INPUTS` planes.
    pub(crate) inputs: Vec<T>,
    /// One stack of planes per hidden layer.
    pub(crate) hidden: Vec<Vec<T>>,
    pub(crate) step: Vec<T>,
}

/// Planes of the inputs.
pub(super) mod input {
    pub(crate) const MISSING: usize = 0;
    pub(crate) const PAINT: usize = 1;
    pub(crate) const STIFFNESS: usize = 2;
    pub(crate) const LAST_STEP: usize = 3;
    pub(crate) const QUARTERS: usize = 4;
}

impl<T: Real> Pass<T> {
    pub(crate) fn new(field: &Field<T>, shape: &Shape) -> Self {
        Self {
            ink: field.pixels.planes(1),
            slope: field.pixels.planes(1),
            inputs: field.cells.planes(INPUTS),
            hidden: vec![field.cells.planes(shape.channels); shape.layers],
            step: field.cells.planes(1),
        }
    }

    /// Renders `paint` over what was there: ink and slope.
    pub(crate) fn look(&mut self, field: &Field<T>, paint: &[T], scratch: &mut Scratch<T>) {
        let pixels = &field.pixels;
        field.spread.spread(&field.cells, paint, pixels, &mut self.ink, &mut scratch.spread);
        for y in 0..pixels.height {
            let ink = pixels.blocks_mut(&mut self.ink, 0, y);
            for (c, &before) in ink.iter_mut().zip(&field.before[pixels.at(0, y)..]) {
                *c += before;
            }
            field.law.apply(ink, pixels.blocks_mut(&mut self.slope, 0, y));
        }
    }

    /// From the canvas to the inputs of the network.
    pub(crate) fn sense(&mut self, field: &Field<T>, paint: &[T], last_step: &[T], scratch: &mut Scratch<T>) {
        let (cells, pixels) = (&field.cells, &field.pixels);
        let damping = T::of(DAMPING);
        let (pull, rest) = scratch.pixels.split_at_mut(pixels.plane());
        let (stiff, missing) = rest.split_at_mut(pixels.plane());
        for y in 0..pixels.height {
            let at = pixels.at(0, y)..pixels.at(0, y) + pixels.width.next_multiple_of(BLOCK);
            let (ink, slope) = (&self.ink[at.clone()], &self.slope[at.clone()]);
            let (wanted, weight) = (&field.wanted[at.clone()], &field.weight[at.clone()]);
            let (pull, stiff, missing) = (&mut pull[at.clone()], &mut stiff[at.clone()], &mut missing[at]);
            for k in 0..ink.len() {
                let (w, r, weight) = (slope[k], wanted[k] - ink[k], weight[k]);
                pull[k] = weight * w * r;
                stiff[k] = weight * w * w;
                missing[k] = pull[k] / (w * w + damping);
            }
        }
        field.spread.mean(cells, &mut self.inputs, input::MISSING, pixels, pull, &mut scratch.spread);
        field.spread.mean(cells, &mut self.inputs, input::STIFFNESS, pixels, stiff, &mut scratch.spread);
        quarters(field, missing, &mut self.inputs);
        for y in 0..cells.height {
            let at = cells.at(0, y)..cells.at(cells.width, y);
            let (first, rest) = self.inputs.split_at_mut(cells.plane());
            let stiffness = &rest[(input::STIFFNESS - 1) * cells.plane()..][at.clone()];
            for (q, &stiffness) in first[at.clone()].iter_mut().zip(stiffness) {
                *q = *q / (stiffness + T::of(SOFTEST));
            }
            cells.row_mut(&mut self.inputs, input::PAINT, y).copy_from_slice(&paint[at.clone()]);
            cells.row_mut(&mut self.inputs, input::LAST_STEP, y).copy_from_slice(&last_step[at]);
        }
    }

    /// The network proper: from the inputs to the step it wants to take.
    pub(crate) fn think(&mut self, field: &Field<T>, block: &Block<T>, stage: usize) {
        let (cells, p) = (&field.cells, &block.parameters);
        let bias = block.sense_bias(stage, &field.settings);
        block.sense.apply(cells, &self.inputs, &mut self.hidden[0], Start::Bias(&bias), true);
        for (layer, (packed, (_, bias))) in block.think.iter().zip(&block.layout.think).enumerate() {
            let (before, after) = self.hidden.split_at_mut(layer + 1);
            let start = Start::Bias(&p[bias.clone()]);
            packed.apply(cells, &before[layer], &mut after[0], start, true);
        }
        let bias = Start::Bias(std::slice::from_ref(&p[block.layout.act_bias]));
        let linear = &block.linear[stage.min(block.shape.stages - 1)];
        linear.apply(cells, &self.inputs, &mut self.step, bias, false);
        let last = &self.hidden[block.shape.layers - 1];
        block.act.apply(cells, last, &mut self.step, Start::Output, false);
    }

    /// Takes the step within `[0, top]`; `paint` and `last_step` are replaced. A bare cell that is not short of paint stays
    /// bare: an empty picture gets exactly nothing.
    pub(crate) fn act(&self, field: &Field<T>, paint: &mut [T], last_step: &mut [T]) {
        let cells = &field.cells;
        for y in 0..cells.height {
            let at = cells.at(0, y)..cells.at(cells.width, y);
            let (missing, step, top) = (&self.inputs[at.clone()], &self.step[at.clone()], &field.top[at.clone()]);
            let (paint, last_step) = (&mut paint[at.clone()], &mut last_step[at]);
            for k in 0..paint.len() {
                let before = paint[k];
                let after = (before + step[k]).at_least(T::default()).at_most(top[k]);
                paint[k] = if is_closed(before, missing[k]) { before } else { after };
                last_step[k] = paint[k] - before;
            }
        }
    }
}

/// Whether a cell stays bare whatever the network says.
pub(super) fn is_closed<T: Real>(paint: T, missing: T) -> bool {
    paint <= T::default() && missing <= T::default()
}

/// First pixels, and their number, of the two halves of a cell that is `stride` wide; the halves overlap if that is odd.
pub(super) fn halves(stride: usize) -> ([usize; 2], usize) {
    let half = stride.div_ceil(2);
    ([0, stride - half], half)
}

/// Means over the four quarters of every cell, into the last four inputs.
fn quarters<T: Real>(field: &Field<T>, pixels: &[T], inputs: &mut [T]) {
    let (cells, (along, down)) = (&field.cells, field.spread.stride());
    let ((lefts, wide), (tops, high)) = (halves(along), halves(down));
    let share = T::of(1.0 / (wide * high) as f64);
    let grid: &Grid = &field.pixels;
    for (quarter, (dy, dx)) in tops.iter().flat_map(|&t| lefts.iter().map(move |&l| (t, l))).enumerate() {
        for j in 0..cells.height {
            let out = cells.row_mut(inputs, input::QUARTERS + quarter, j);
            out.fill(T::default());
            for y in (j * down + dy..j * down + dy + high).take_while(|&y| y < grid.height) {
                let row = grid.row(pixels, 0, y);
                for x in dx..dx + wide {
                    for (o, &v) in out.iter_mut().zip(row.iter().skip(x).step_by(along)) {
                        *o += share * v;
                    }
                }
            }
        }
    }
}
