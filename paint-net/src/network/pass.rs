//! One pass of the feedback network: render, features, prediction, update.

use super::architecture::{Architecture, INPUTS, Layout};
use super::conv::{Packed, Start};
use super::padded_grid::{BLOCK, PaddedGrid};
use super::real::Real;
use super::tile_problem::{Scratch, TileProblem};

/// Damping of the missing depth `r w / (w² + damping)` of a pixel: where ink is saturated, no depth is missing.
pub(super) const DAMPING: f64 = 0.05;
/// Least curvature of a cell.
pub(super) const MIN_CURVATURE: f64 = 1e-3;

/// The weights, ordered for the inner loops.
#[derive(Debug, Clone)]
pub(crate) struct PackedNetwork<T> {
    pub(super) architecture: Architecture,
    pub(super) layout: Layout,
    pub(super) parameters: Vec<T>,
    features_layer: Packed<T>,
    hidden_layers: Vec<Packed<T>>,
    output_layer: Packed<T>,
    linear: Vec<Packed<T>>,
}

impl<T: Real> PackedNetwork<T> {
    pub(crate) fn new(architecture: Architecture, parameters: Vec<T>) -> Self {
        let layout = architecture.layout();
        let (p, c) = (&parameters, architecture.channels);
        Self {
            features_layer: Packed::new(&p[layout.features_layer.clone()], INPUTS, c),
            hidden_layers: layout
                .hidden_layers
                .iter()
                .map(|(weights, _)| Packed::new(&p[weights.clone()], c, c))
                .collect(),
            output_layer: Packed::new(&p[layout.output_layer.clone()], c, 1),
            linear: (0..architecture.stages)
                .map(|stage| Packed::new(&p[architecture.linear_of(&layout, stage)], INPUTS, 1))
                .collect(),
            architecture,
            layout,
            parameters,
        }
    }

    pub(crate) fn architecture(&self) -> Architecture {
        self.architecture
    }

    #[cfg(feature = "train")]
    pub(crate) fn parameters(&self) -> &[T] {
        &self.parameters
    }

    /// Bias of the first layer: of the stage and of the nozzle.
    fn features_bias(&self, stage: usize, conditioning: &[T; 2]) -> Vec<T> {
        let own = &self.parameters[self.architecture.bias_of(&self.layout, stage)];
        let by_condition = self.parameters[self.layout.conditioning.clone()].chunks_exact(conditioning.len());
        own.iter().zip(by_condition).map(|(&b, u)| b + u[0] * conditioning[0] + u[1] * conditioning[1]).collect()
    }
}

/// One pass and everything computed on the way, so that it can be differentiated.
#[derive(Debug, Clone)]
pub(crate) struct Pass<T> {
    /// Ink and slope of the response, as the canvas is before the pass.
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
    pub(crate) const CURVATURE: usize = 2;
    pub(crate) const LAST_STEP: usize = 3;
    pub(crate) const QUADRANTS: usize = 4;
}

impl<T: Real> Pass<T> {
    pub(crate) fn new(problem: &TileProblem<T>, architecture: &Architecture) -> Self {
        Self {
            ink: problem.pixels.planes(1),
            slope: problem.pixels.planes(1),
            inputs: problem.cells.planes(INPUTS),
            hidden: vec![problem.cells.planes(architecture.channels); architecture.layers],
            step: problem.cells.planes(1),
        }
    }

    /// Renders `paint` over what was there: ink and slope.
    pub(crate) fn render(&mut self, problem: &TileProblem<T>, paint: &[T], scratch: &mut Scratch<T>) {
        let pixels = &problem.pixels;
        problem.footprint.deposit(&problem.cells, paint, pixels, &mut self.ink, &mut scratch.phases);
        for y in 0..pixels.height {
            let ink = pixels.blocks_mut(&mut self.ink, 0, y);
            for (c, &before) in ink.iter_mut().zip(&problem.before[pixels.at(0, y)..]) {
                *c += before;
            }
            problem.response.apply(ink, pixels.blocks_mut(&mut self.slope, 0, y));
        }
    }

    /// From the canvas to the inputs of the network.
    pub(crate) fn features(
        &mut self,
        problem: &TileProblem<T>,
        paint: &[T],
        last_step: &[T],
        scratch: &mut Scratch<T>,
    ) {
        let (cells, pixels) = (&problem.cells, &problem.pixels);
        let damping = T::of(DAMPING);
        let (weighted_residual, rest) = scratch.pixels.split_at_mut(pixels.plane());
        let (curvature_term, missing) = rest.split_at_mut(pixels.plane());
        for y in 0..pixels.height {
            let at = pixels.at(0, y)..pixels.at(0, y) + pixels.width.next_multiple_of(BLOCK);
            let (ink, slope) = (&self.ink[at.clone()], &self.slope[at.clone()]);
            let (wanted, weight) = (&problem.wanted[at.clone()], &problem.weight[at.clone()]);
            let (weighted_residual, curvature_term, missing) =
                (&mut weighted_residual[at.clone()], &mut curvature_term[at.clone()], &mut missing[at]);
            for k in 0..ink.len() {
                let (w, r, weight) = (slope[k], wanted[k] - ink[k], weight[k]);
                weighted_residual[k] = weight * w * r;
                curvature_term[k] = weight * w * w;
                missing[k] = weighted_residual[k] / (w * w + damping);
            }
        }
        problem.footprint.mean(cells, &mut self.inputs, input::MISSING, pixels, weighted_residual, &mut scratch.phases);
        problem.footprint.mean(cells, &mut self.inputs, input::CURVATURE, pixels, curvature_term, &mut scratch.phases);
        quadrant_means(problem, missing, &mut self.inputs);
        for y in 0..cells.height {
            let at = cells.at(0, y)..cells.at(cells.width, y);
            let (first, rest) = self.inputs.split_at_mut(cells.plane());
            let curvature = &rest[(input::CURVATURE - 1) * cells.plane()..][at.clone()];
            for (q, &curvature) in first[at.clone()].iter_mut().zip(curvature) {
                *q = *q / (curvature + T::of(MIN_CURVATURE));
            }
            cells.row_mut(&mut self.inputs, input::PAINT, y).copy_from_slice(&paint[at.clone()]);
            cells.row_mut(&mut self.inputs, input::LAST_STEP, y).copy_from_slice(&last_step[at]);
        }
    }

    /// The network proper: from the inputs to the step it wants to take.
    pub(crate) fn predict(&mut self, problem: &TileProblem<T>, network: &PackedNetwork<T>, stage: usize) {
        let (cells, p) = (&problem.cells, &network.parameters);
        let bias = network.features_bias(stage, &problem.conditioning);
        network.features_layer.apply(cells, &self.inputs, &mut self.hidden[0], Start::Bias(&bias), true);
        for (layer, (packed, (_, bias))) in network.hidden_layers.iter().zip(&network.layout.hidden_layers).enumerate()
        {
            let (before, after) = self.hidden.split_at_mut(layer + 1);
            let start = Start::Bias(&p[bias.clone()]);
            packed.apply(cells, &before[layer], &mut after[0], start, true);
        }
        let bias = Start::Bias(std::slice::from_ref(&p[network.layout.output_bias]));
        let linear = &network.linear[stage.min(network.architecture.stages - 1)];
        linear.apply(cells, &self.inputs, &mut self.step, bias, false);
        let last = &self.hidden[network.architecture.layers - 1];
        network.output_layer.apply(cells, last, &mut self.step, Start::Output, false);
    }

    /// Takes the step within the bounds; `paint` and `last_step` are replaced. A bare cell that is not short of paint stays
    /// bare: an empty picture gets exactly nothing.
    pub(crate) fn update(&self, problem: &TileProblem<T>, paint: &mut [T], last_step: &mut [T]) {
        let cells = &problem.cells;
        for y in 0..cells.height {
            let at = cells.at(0, y)..cells.at(cells.width, y);
            let (missing, step, upper_bounds) =
                (&self.inputs[at.clone()], &self.step[at.clone()], &problem.upper_bounds[at.clone()]);
            let (paint, last_step) = (&mut paint[at.clone()], &mut last_step[at]);
            for k in 0..paint.len() {
                let before = paint[k];
                let after = (before + step[k]).at_least(T::default()).at_most(upper_bounds[k]);
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

/// Means over the four quadrants of every cell, into the last four inputs.
fn quadrant_means<T: Real>(problem: &TileProblem<T>, pixels: &[T], inputs: &mut [T]) {
    let (cells, (along, down)) = (&problem.cells, problem.footprint.stride());
    let ((lefts, wide), (tops, high)) = (halves(along), halves(down));
    let share = T::of(1.0 / (wide * high) as f64);
    let grid: &PaddedGrid = &problem.pixels;
    for (quadrant, (dy, dx)) in tops.iter().flat_map(|&t| lefts.iter().map(move |&l| (t, l))).enumerate() {
        for j in 0..cells.height {
            let out = cells.row_mut(inputs, input::QUADRANTS + quadrant, j);
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
