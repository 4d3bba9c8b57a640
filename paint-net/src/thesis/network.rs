use super::rollout::Model;
use super::shape::Shape;
use crate::error::Error;
use crate::network::{Tensor, layout, safetensors};
use crate::procedural::lattice;

/// The weights of the thesis' network.
#[derive(Debug, Clone, PartialEq)]
pub struct Network {
    shape: Shape,
    parameters: Vec<f32>,
}

/// Tensor that holds the sizes.
const SHAPE: &str = "shape";
/// First bias of the volume: many small sprays rather than a black wall, whose derivatives vanish (ours).
const FIRST_VOLUME: f32 = -2.0;
/// First biases of READ's log variance and log spacing: wide filters over the middle of the picture, which see enough to learn
/// from; narrow ones would see a few pixels of its border (ours).
const FIRST_WINDOW: [f32; 2] = [2.0, -0.5];

impl Network {
    /// Untrained weights: uniform within one over the root of the inputs; forget gates start open (bias 1).
    pub fn random(shape: Shape, seed: u64) -> Result<Self, Error> {
        shape.check()?;
        let mut parameters = vec![0.0_f32; shape.parameters()];
        let layers = shape.layers();
        for layer in layers.all() {
            let half_width = 1.0 / (layer.inputs as f64).sqrt();
            for k in layer.weight() {
                parameters[k] = (half_width * (2.0 * lattice(seed, k as i64, -5) - 1.0)) as f32;
            }
        }
        for layer in [layers.encoder, layers.decoder] {
            let forget = layer.bias().start + shape.hidden;
            parameters[forget..forget + shape.hidden].fill(1.0);
        }
        parameters[layers.spray.bias().start + 3] = FIRST_VOLUME;
        let window = layers.attention.bias().start + 2;
        parameters[window..window + 2].copy_from_slice(&FIRST_WINDOW);
        Ok(Self { shape, parameters })
    }

    /// From the bytes of a safetensors file.
    pub fn from_safetensors(bytes: &[u8]) -> Result<Self, Error> {
        Self::from_tensors(&safetensors::read(bytes)?.0)
    }

    pub(crate) fn from_tensors(tensors: &[Tensor]) -> Result<Self, Error> {
        let &[side, steps, latent, hidden, read, radius, stop, paint] = layout::find(tensors, SHAPE)?.values.as_slice()
        else {
            return Err(Error::Weights(format!("the tensor {SHAPE} does not hold eight sizes")));
        };
        // What is no size at all becomes 0 here, which is refused.
        let whole = |size: f32| size as usize;
        let shape = Shape {
            side: whole(side),
            steps: whole(steps),
            latent: whole(latent),
            hidden: whole(hidden),
            read: whole(read),
            radius: f64::from(radius),
            stop: f64::from(stop),
            paint: whole(paint),
        };
        shape.check()?;
        let parameters = layout::parameters(tensors, &shape.parts())?;
        Ok(Self { shape, parameters })
    }

    /// The bytes of a safetensors file, with notes for whoever reads it.
    pub fn to_safetensors(&self, notes: &[(&str, String)]) -> Vec<u8> {
        safetensors::write(&self.tensors(), notes)
    }

    pub(crate) fn tensors(&self) -> Vec<Tensor> {
        let s = &self.shape;
        let sizes = [s.side, s.steps, s.latent, s.hidden, s.read].map(|n| n as f32);
        let sizes = [&sizes[..], &[s.radius as f32, s.stop as f32, s.paint as f32]].concat();
        let mut tensors = vec![Tensor { name: SHAPE.into(), shape: vec![sizes.len()], values: sizes }];
        tensors.extend(layout::tensors(&self.parameters, self.shape.parts()));
        tensors
    }

    /// Sizes.
    pub fn shape(&self) -> Shape {
        self.shape
    }

    /// Number of weights.
    pub fn parameters(&self) -> usize {
        self.parameters.len()
    }

    pub(crate) fn model(&self) -> Model<f32> {
        Model::new(&self.shape, &self.parameters)
    }

    #[cfg(feature = "train")]
    pub(crate) fn from_parameters(shape: Shape, parameters: Vec<f32>) -> Self {
        Self { shape, parameters }
    }

    #[cfg(feature = "train")]
    pub(crate) fn into_parameters(self) -> Vec<f32> {
        self.parameters
    }
}
