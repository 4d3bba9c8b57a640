//! Sizes of the feedback network, and where its parameters lie.

use std::ops::Range;

use super::layout::Part;
use crate::error::{Error, require};

/// What the network sees of a cell, in this order: missing depth under the footprint, paint, curvature, last step, and the
/// missing depth of the cell's four quadrants.
pub(crate) const INPUTS: usize = 8;
/// Numbers that describe the nozzle and the grid.
pub(crate) const CONDITIONS: usize = 2;
/// Weights of one kernel.
const TAPS: usize = 9;

/// Sizes of the network. Defaults are those of the shipped weights.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Architecture {
    /// Channels of every hidden layer. Default 12, ours.
    pub channels: usize,
    /// Hidden layers, each a 3x3 convolution and a rectifier. Default 2, ours.
    pub layers: usize,
    /// Passes that have a bias and linear part of their own; later passes use the last. Default 8, ours.
    pub stages: usize,
}

impl Default for Architecture {
    fn default() -> Self {
        Self { channels: 12, layers: 2, stages: 8 }
    }
}

impl Architecture {
    pub(crate) fn check(&self) -> Result<(), Error> {
        let within =
            |name, value: usize, most: usize, rule| require(name, value as f64, (1..=most).contains(&value), rule);
        within("channels", self.channels, 64, "it must lie in 1..=64")?;
        within("layers", self.layers, 8, "it must lie in 1..=8")?;
        within("stages", self.stages, 64, "it must lie in 1..=64")
    }

    /// Where each tensor lies among the parameters, with its name and extents.
    pub(crate) fn tensors(&self) -> Vec<Part> {
        let (c, n) = (self.channels, self.stages);
        let mut list = vec![("features.weight".to_string(), vec![c, INPUTS, 3, 3])];
        list.push(("features.bias".to_string(), vec![n, c]));
        list.push(("features.conditioning".to_string(), vec![c, CONDITIONS]));
        for layer in 1..self.layers {
            list.push((format!("hidden{layer}.weight"), vec![c, c, 3, 3]));
            list.push((format!("hidden{layer}.bias"), vec![c]));
        }
        list.push(("output.weight".to_string(), vec![1, c, 3, 3]));
        list.push(("output.linear".to_string(), vec![n, INPUTS, 3, 3]));
        list.push(("output.bias".to_string(), vec![1]));
        let mut at = 0;
        list.into_iter()
            .map(|(name, extents)| {
                let from = at;
                at += extents.iter().product::<usize>();
                (name, extents, from..at)
            })
            .collect()
    }

    pub(crate) fn parameters(&self) -> usize {
        self.tensors().last().map_or(0, |t| t.2.end)
    }

    /// Where the parts lie, by role.
    pub(crate) fn layout(&self) -> Layout {
        let mut ranges = self.tensors().into_iter().map(|t| t.2);
        let mut next = || ranges.next().unwrap_or_default();
        let (features_layer, features_bias, conditioning) = (next(), next(), next());
        let hidden_layers = (1..self.layers).map(|_| (next(), next())).collect();
        Layout {
            features_layer,
            features_bias,
            conditioning,
            hidden_layers,
            output_layer: next(),
            linear: next(),
            output_bias: next().start,
        }
    }

    /// Weights of one stage's linear part, and of its bias.
    pub(crate) fn linear_of(&self, layout: &Layout, stage: usize) -> Range<usize> {
        let (stage, size) = (stage.min(self.stages - 1), INPUTS * TAPS);
        layout.linear.start + stage * size..layout.linear.start + (stage + 1) * size
    }

    /// First-layer bias of one stage.
    pub(crate) fn bias_of(&self, layout: &Layout, stage: usize) -> Range<usize> {
        let (stage, size) = (stage.min(self.stages - 1), self.channels);
        layout.features_bias.start + stage * size..layout.features_bias.start + (stage + 1) * size
    }
}

/// Ranges of the parameters by role.
#[derive(Debug, Clone)]
pub(crate) struct Layout {
    pub(crate) features_layer: Range<usize>,
    pub(crate) features_bias: Range<usize>,
    pub(crate) conditioning: Range<usize>,
    /// Weights and biases of the further hidden layers.
    pub(crate) hidden_layers: Vec<(Range<usize>, Range<usize>)>,
    pub(crate) output_layer: Range<usize>,
    pub(crate) linear: Range<usize>,
    pub(crate) output_bias: usize,
}
