//! Linear layers over a batch, and their adjoint.

use super::architecture::Layer;
use super::matrix::Panels;
#[cfg(any(test, feature = "train"))]
use super::matrix::transposed;
use crate::network::Real;

/// A layer ready to be applied.
#[derive(Debug, Clone)]
pub(crate) struct Dense<T> {
    weight: Panels<T>,
    bias: Vec<T>,
}

impl<T: Real> Dense<T> {
    pub(crate) fn new(layer: &Layer, parameters: &[T]) -> Self {
        let weight = Panels::new(&parameters[layer.weight()], layer.outputs);
        Self { weight, bias: parameters[layer.bias()].to_vec() }
    }

    /// `out = inputs W + b`, a row per sample.
    pub(crate) fn apply(&self, inputs: &[T], out: &mut [T]) {
        for row in out.chunks_exact_mut(self.bias.len()) {
            row.copy_from_slice(&self.bias);
        }
        self.weight.add_product(inputs, out);
    }
}

#[cfg(any(test, feature = "train"))]
/// The backward pass through a layer.
#[derive(Debug, Clone)]
pub(crate) struct DenseAdjoint<T> {
    layer: Layer,
    across: Panels<T>,
}

#[cfg(any(test, feature = "train"))]
impl<T: Real> DenseAdjoint<T> {
    pub(crate) fn new(layer: &Layer, parameters: &[T]) -> Self {
        let across = transposed(&parameters[layer.weight()], layer.outputs);
        Self { layer: *layer, across: Panels::new(&across, layer.inputs) }
    }

    /// Adds the derivative by the inputs, given that by the outputs.
    pub(crate) fn add_inputs(&self, outputs: &[T], inputs: &mut [T]) {
        self.across.add_product(outputs, inputs);
    }

    /// Adds the derivative by weights and bias: the sum over all rows, of all samples and steps.
    pub(crate) fn add_weights(&self, inputs: &[T], outputs: &[T], gradient: &mut [T]) {
        let count = self.layer.outputs;
        let right = Panels::new(outputs, count);
        right.add_product(&transposed(inputs, self.layer.inputs), &mut gradient[self.layer.weight()]);
        let bias = &mut gradient[self.layer.bias()];
        for row in outputs.chunks_exact(count) {
            for (sum, &d) in bias.iter_mut().zip(row) {
                *sum += d;
            }
        }
    }
}
