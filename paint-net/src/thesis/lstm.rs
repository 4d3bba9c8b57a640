//! A recurrent layer with long short-term memory (Hochreiter and Schmidhuber 1997, with forget gates).

use super::activations::Activations;
use super::dense::Dense;
#[cfg(any(test, feature = "train"))]
use super::dense::DenseAdjoint;
use super::nonlinearities::{sigmoid, tanh};
use crate::network::Real;

/// What the layer did: `steps` rows of inputs and gates, `steps + 1` of memory and state, the first of which are zero.
///
/// ```text
/// i, f, o = σ(..),  u = tanh(..)      of   inputs W + b,   inputs = [given, own state before]
/// memory' = f memory + i u,   state' = o tanh(memory')
/// ```
#[derive(Debug, Clone)]
pub(crate) struct Lstm<T> {
    hidden: usize,
    pub(crate) inputs: Activations<T>,
    gates: Activations<T>,
    memory: Activations<T>,
    pub(crate) state: Activations<T>,
}

impl<T: Real> Lstm<T> {
    /// `given`: numbers from outside per step.
    pub(crate) fn new(steps: usize, batch: usize, given: usize, hidden: usize) -> Self {
        Self {
            hidden,
            inputs: Activations::new(steps, batch, given + hidden),
            gates: Activations::new(steps, batch, 4 * hidden),
            memory: Activations::new(steps + 1, batch, hidden),
            state: Activations::new(steps + 1, batch, hidden),
        }
    }

    /// One step, after what is given was written into the inputs.
    pub(crate) fn step(&mut self, t: usize, layer: &Dense<T>) {
        let h = self.hidden;
        let (before, state) = self.state.pair(t);
        let inputs = self.inputs.at_mut(t);
        let width = inputs.len() / (before.len() / h);
        for (row, before) in inputs.chunks_exact_mut(width).zip(before.chunks_exact(h)) {
            row[width - h..].copy_from_slice(before);
        }
        let gates = self.gates.at_mut(t);
        layer.apply(inputs, gates);
        let (before, memory) = self.memory.pair(t);
        let rows = gates.chunks_exact_mut(4 * h).zip(before.chunks_exact(h));
        for (((gates, before), memory), state) in rows.zip(memory.chunks_exact_mut(h)).zip(state.chunks_exact_mut(h)) {
            let (open, update) = gates.split_at_mut(3 * h);
            for g in open.iter_mut() {
                *g = sigmoid(*g);
            }
            for u in update.iter_mut() {
                *u = tanh(*u);
            }
            let (input, rest) = open.split_at(h);
            let (forget, output) = rest.split_at(h);
            for k in 0..h {
                memory[k] = forget[k] * before[k] + input[k] * update[k];
                state[k] = output[k] * tanh(memory[k]);
            }
        }
    }

    #[cfg(any(test, feature = "train"))]
    /// The backward pass through step `t`: `memory` and `state` hold the derivatives by what the step left; afterwards `memory`
    /// holds those by what it found, and `inputs` those by the inputs, own state included. The gates are overwritten with
    /// their derivatives, for [`Lstm::add_weights`].
    pub(crate) fn backward(
        &mut self,
        t: usize,
        layer: &DenseAdjoint<T>,
        memory: &mut [T],
        state: &[T],
        inputs: &mut [T],
    ) {
        let h = self.hidden;
        let one = T::of(1.0);
        let (before, after) = (self.memory.at(t), self.memory.at(t + 1));
        let rows = self.gates.at_mut(t).chunks_exact_mut(4 * h).enumerate();
        for (row, gates) in rows {
            let at = row * h..(row + 1) * h;
            let (before, after, d_state) = (&before[at.clone()], &after[at.clone()], &state[at.clone()]);
            let d_memory = &mut memory[at];
            let (input, rest) = gates.split_at_mut(h);
            let (forget, rest) = rest.split_at_mut(h);
            let (output, update) = rest.split_at_mut(h);
            for k in 0..h {
                let (i, f, o, u) = (input[k], forget[k], output[k], update[k]);
                let shown = tanh(after[k]);
                let d = d_memory[k] + d_state[k] * o * (one - shown * shown);
                output[k] = d_state[k] * shown * o * (one - o);
                input[k] = d * u * i * (one - i);
                forget[k] = d * before[k] * f * (one - f);
                update[k] = d * i * (one - u * u);
                d_memory[k] = d * f;
            }
        }
        inputs.fill(T::default());
        layer.add_inputs(self.gates.at(t), inputs);
    }

    #[cfg(any(test, feature = "train"))]
    /// Adds the derivative by the weights, after the backward pass through all `steps`.
    pub(crate) fn add_weights(&self, layer: &DenseAdjoint<T>, steps: usize, gradient: &mut [T]) {
        layer.add_weights(self.inputs.steps(0..steps), self.gates.steps(0..steps), gradient);
    }
}
