//! The weights of the feedback network.

use super::architecture::{Architecture, INPUTS};
use super::layout;
use super::pass::PackedNetwork;
use super::safetensors::{self, Storage, Tensor};
use crate::error::Error;
use crate::procedural::lattice;

/// The weights of the feedback painter.
#[derive(Debug, Clone, PartialEq)]
pub struct Network {
    architecture: Architecture,
    parameters: Vec<f32>,
}

impl Network {
    /// Untrained weights: uniform with the variance that keeps the size of rectified signals (He et al. 2015); the last layer
    /// starts small, and the linear part with a plain gradient step.
    pub fn random(architecture: Architecture, seed: u64) -> Self {
        let layout = architecture.layout();
        let mut parameters = vec![0.0_f32; architecture.parameters()];
        let mut fill = |range: std::ops::Range<usize>, half_width: f64| {
            for k in range {
                parameters[k] = (half_width * (2.0 * lattice(seed, k as i64, -3) - 1.0)) as f32;
            }
        };
        let width = |inputs: usize| (6.0 / (9 * inputs) as f64).sqrt();
        fill(layout.features_layer.clone(), width(INPUTS));
        for (weights, _) in &layout.hidden_layers {
            fill(weights.clone(), width(architecture.channels));
        }
        fill(layout.output_layer.clone(), 0.1 * width(architecture.channels));
        for stage in 0..architecture.stages {
            // The middle tap of the first input: the missing depth.
            parameters[architecture.linear_of(&layout, stage).start + 4] = 1.0;
        }
        Self { architecture, parameters }
    }

    /// The weights that come with the crate.
    pub fn shipped() -> Result<Self, Error> {
        Self::from_safetensors(include_bytes!("../../weights/painter.safetensors"))
    }

    /// From the bytes of a safetensors file.
    pub fn from_safetensors(bytes: &[u8]) -> Result<Self, Error> {
        Self::from_tensors(&safetensors::read(bytes)?.0, None)
    }

    /// From tensors among which those of the network are; `architecture` if it is known.
    pub(crate) fn from_tensors(tensors: &[Tensor], architecture: Option<Architecture>) -> Result<Self, Error> {
        let architecture = match (architecture, layout::find(tensors, "features.bias")?.shape.as_slice()) {
            (Some(architecture), _) => architecture,
            (None, &[stages, channels]) => {
                let further = tensors.iter().filter(|t| t.name.starts_with("hidden") && t.name.ends_with("weight"));
                Architecture { channels, layers: 1 + further.count(), stages }
            }
            (None, _) => return Err(Error::Weights("features.bias does not have two extents".to_string())),
        };
        architecture.check()?;
        let parameters = layout::parameters(tensors, &architecture.tensors())?;
        Ok(Self { architecture, parameters })
    }

    /// The bytes of a safetensors file, with notes for whoever reads it.
    pub fn to_safetensors(&self, notes: &[(&str, String)]) -> Vec<u8> {
        safetensors::write(&self.tensors(), notes, Storage::Whole)
    }

    pub(crate) fn tensors(&self) -> Vec<Tensor> {
        layout::tensors(&self.parameters, self.architecture.tensors())
    }

    #[cfg(feature = "train")]
    pub(crate) fn from_parameters(architecture: Architecture, parameters: Vec<f32>) -> Self {
        Self { architecture, parameters }
    }

    #[cfg(feature = "train")]
    pub(crate) fn into_parameters(self) -> Vec<f32> {
        self.parameters
    }

    /// Its sizes.
    pub fn architecture(&self) -> Architecture {
        self.architecture
    }

    /// Number of weights.
    pub fn parameters(&self) -> usize {
        self.parameters.len()
    }

    pub(crate) fn packed(&self) -> PackedNetwork<f32> {
        PackedNetwork::new(self.architecture, self.parameters.clone())
    }
}
