//! The feedback painter's network.
#[cfg(any(test, feature = "train"))]
mod adjoint;
mod conv;
mod field;
mod law;
pub(crate) mod layout;
mod pass;
mod planes;
mod real;
pub(crate) mod safetensors;
mod shape;
mod spread;
mod tiles;
#[cfg(any(test, feature = "train"))]
mod trace;

#[cfg(feature = "train")]
pub(crate) use adjoint::Adjoint;
#[cfg(feature = "train")]
pub(crate) use field::Field;
pub(crate) use law::{Law, Scaled};
pub(crate) use pass::Block;
pub(crate) use planes::{BLOCK, Grid};
pub(crate) use real::Real;
pub use shape::Shape;
pub(crate) use spread::Spread;
pub(crate) use tiles::{State, Tiles};
#[cfg(feature = "train")]
pub(crate) use trace::Trace;

use crate::error::Error;
use crate::procedural::lattice;
pub(crate) use safetensors::Tensor;

/// The weights of the feedback painter.
#[derive(Debug, Clone, PartialEq)]
pub struct Network {
    shape: Shape,
    parameters: Vec<f32>,
}

impl Network {
    /// Untrained weights: uniform with the variance that keeps the size of rectified signals (He et al. 2015); the last layer
    /// starts small, and the linear part with a plain gradient step.
    pub fn random(shape: Shape, seed: u64) -> Self {
        let layout = shape.layout();
        let mut parameters = vec![0.0_f32; shape.parameters()];
        let mut fill = |range: std::ops::Range<usize>, half_width: f64| {
            for k in range {
                parameters[k] = (half_width * (2.0 * lattice(seed, k as i64, -3) - 1.0)) as f32;
            }
        };
        let width = |inputs: usize| (6.0 / (9 * inputs) as f64).sqrt();
        fill(layout.sense.clone(), width(shape::INPUTS));
        for (weights, _) in &layout.think {
            fill(weights.clone(), width(shape.channels));
        }
        fill(layout.act.clone(), 0.1 * width(shape.channels));
        for stage in 0..shape.stages {
            // The middle tap of the first input: the missing depth.
            parameters[shape.linear_of(&layout, stage).start + 4] = 1.0;
        }
        Self { shape, parameters }
    }

    /// The weights that come with the crate.
    pub fn shipped() -> Result<Self, Error> {
        Self::from_safetensors(include_bytes!("../weights/painter.safetensors"))
    }

    /// From the bytes of a safetensors file.
    pub fn from_safetensors(bytes: &[u8]) -> Result<Self, Error> {
        Self::from_tensors(&safetensors::read(bytes)?.0, None)
    }

    /// From tensors among which those of the network are; `shape` if it is known.
    pub(crate) fn from_tensors(tensors: &[Tensor], shape: Option<Shape>) -> Result<Self, Error> {
        let shape = match (shape, layout::find(tensors, "sense.bias")?.shape.as_slice()) {
            (Some(shape), _) => shape,
            (None, &[stages, channels]) => {
                let further = tensors.iter().filter(|t| t.name.starts_with("think") && t.name.ends_with("weight"));
                Shape { channels, layers: 1 + further.count(), stages }
            }
            (None, _) => return Err(Error::Weights("sense.bias does not have two extents".to_string())),
        };
        shape.check()?;
        let parameters = layout::parameters(tensors, &shape.tensors())?;
        Ok(Self { shape, parameters })
    }

    /// The bytes of a safetensors file, with notes for whoever reads it.
    pub fn to_safetensors(&self, notes: &[(&str, String)]) -> Vec<u8> {
        safetensors::write(&self.tensors(), notes)
    }

    pub(crate) fn tensors(&self) -> Vec<Tensor> {
        layout::tensors(&self.parameters, self.shape.tensors())
    }

    #[cfg(feature = "train")]
    pub(crate) fn from_parameters(shape: Shape, parameters: Vec<f32>) -> Self {
        Self { shape, parameters }
    }

    #[cfg(feature = "train")]
    pub(crate) fn into_parameters(self) -> Vec<f32> {
        self.parameters
    }

    /// Sizes.
    pub fn shape(&self) -> Shape {
        self.shape
    }

    /// Number of weights.
    pub fn parameters(&self) -> usize {
        self.parameters.len()
    }

    pub(crate) fn block(&self) -> Block<f32> {
        Block::new(self.shape, self.parameters.clone())
    }
}
