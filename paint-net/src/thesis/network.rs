//! The weights of the thesis' network.

use super::architecture::Architecture;
use super::rollout::{Model, Noise, Rollout};
use super::step::{Step, steps_of};
use crate::error::Error;
use crate::image::Image;
use crate::network::layout;
use crate::network::safetensors::{self, Storage, Tensor};
use crate::procedural::lattice;

/// The weights of the thesis' network.
#[derive(Debug, Clone, PartialEq)]
pub struct Network {
    architecture: Architecture,
    parameters: Vec<f32>,
    gated: bool,
}

/// Tensor that holds the sizes.
const SIZES: &str = "shape";
/// Tensor that says whether the stop variable scales the volume; a file without it is of a network whose does.
const GATED: &str = "gated";
/// First bias of the volume: many small sprays rather than a black wall, whose derivatives vanish (ours).
const FIRST_VOLUME: f32 = -2.0;
/// First biases of READ's log variance and log spacing: wide filters over the middle of the picture, which see enough to learn
/// from; narrow ones would see a few pixels of its border (ours).
const FIRST_WINDOW: [f32; 2] = [2.0, -0.5];

impl Network {
    /// Untrained weights: uniform within one over the root of the inputs; forget gates start open (bias 1).
    pub fn random(architecture: Architecture, seed: u64) -> Result<Self, Error> {
        architecture.check()?;
        let mut parameters = vec![0.0_f32; architecture.parameters()];
        let layers = architecture.layers();
        for layer in layers.all() {
            let half_width = 1.0 / (layer.inputs as f64).sqrt();
            for k in layer.weight() {
                parameters[k] = (half_width * (2.0 * lattice(seed, k as i64, -5) - 1.0)) as f32;
            }
        }
        for layer in [layers.encoder, layers.decoder] {
            let forget = layer.bias().start + architecture.hidden;
            parameters[forget..forget + architecture.hidden].fill(1.0);
        }
        parameters[layers.spray.bias().start + 3] = FIRST_VOLUME;
        let window = layers.attention.bias().start + 2;
        parameters[window..window + 2].copy_from_slice(&FIRST_WINDOW);
        Ok(Self { architecture, parameters, gated: true })
    }

    /// The weights that come with the crate, for [`Architecture::PAINT`]: seed and schedule are in the file's notes, the command in the book.
    pub fn shipped() -> Result<Self, Error> {
        Self::from_safetensors(include_bytes!("../../weights/thesis.safetensors"))
    }

    /// From the bytes of a safetensors file.
    pub fn from_safetensors(bytes: &[u8]) -> Result<Self, Error> {
        Self::from_tensors(&safetensors::read(bytes)?.0)
    }

    pub(crate) fn from_tensors(tensors: &[Tensor]) -> Result<Self, Error> {
        let &[side, steps, latent, hidden, read, radius, stop, paint] = layout::find(tensors, SIZES)?.values.as_slice()
        else {
            return Err(Error::Weights(format!("the tensor {SIZES} does not hold eight sizes")));
        };
        // What is no size at all becomes 0 here, which is refused.
        let whole = |size: f32| size as usize;
        let architecture = Architecture {
            side: whole(side),
            steps: whole(steps),
            latent: whole(latent),
            hidden: whole(hidden),
            read: whole(read),
            radius: f64::from(radius),
            stop: f64::from(stop),
            paint: whole(paint),
        };
        architecture.check()?;
        let parameters = layout::parameters(tensors, &architecture.parts())?;
        let gated = tensors.iter().find(|tensor| tensor.name == GATED).is_none_or(|tensor| tensor.values != [0.0]);
        Ok(Self { architecture, parameters, gated })
    }

    /// The bytes of a safetensors file, with notes for whoever reads it.
    pub fn to_safetensors(&self, notes: &[(&str, String)]) -> Vec<u8> {
        safetensors::write(&self.tensors(), notes, Storage::Whole)
    }

    /// The same with every matrix rounded to bytes, each column by its own unit: a quarter of the size.
    pub fn to_small_safetensors(&self, notes: &[(&str, String)]) -> Vec<u8> {
        safetensors::write(&self.tensors(), notes, Storage::Bytes)
    }

    pub(crate) fn tensors(&self) -> Vec<Tensor> {
        let s = &self.architecture;
        let sizes = [s.side, s.steps, s.latent, s.hidden, s.read].map(|n| n as f32);
        let sizes = [&sizes[..], &[s.radius as f32, s.stop as f32, s.paint as f32]].concat();
        let gated = vec![f32::from(u8::from(self.gated))];
        let mut tensors = vec![
            Tensor { name: SIZES.into(), shape: vec![sizes.len()], values: sizes },
            Tensor { name: GATED.into(), shape: vec![1], values: gated },
        ];
        tensors.extend(layout::tensors(&self.parameters, self.architecture.parts()));
        tensors
    }

    /// Sizes.
    pub fn architecture(&self) -> Architecture {
        self.architecture
    }

    /// Whether the stop variable scales the volume of every spray, as it did in training ([`Objective::gated`](super::Objective)).
    pub fn is_gated(&self) -> bool {
        self.gated
    }

    /// Number of weights.
    pub fn parameters(&self) -> usize {
        self.parameters.len()
    }

    /// Paints pictures of `side` x `side` pixels, without noise: for each the steps up to the stop. `pictures`: wanted ink in
    /// `[0, 1]` and the depth of paint that is there already.
    pub fn paint(&self, pictures: &[(Image, Option<Image>)]) -> Result<Vec<Vec<Step>>, Error> {
        if pictures.is_empty() {
            return Ok(Vec::new());
        }
        let architecture = self.architecture;
        let expected = (architecture.side, architecture.side);
        let (mut wanted, mut before) = (Vec::new(), Vec::new());
        for (picture, canvas) in pictures {
            let there = canvas.clone().unwrap_or_else(|| picture.map(|_| 0.0));
            for (what, image) in [("picture", picture), ("canvas", &there)] {
                if image.size() != expected {
                    return Err(Error::Mismatch { what, found: image.size(), expected });
                }
            }
            picture.check_range("picture", 0.0, 1.0, "ink in [0, 1]")?;
            there.check_range("canvas", 0.0, f64::MAX, "a depth of 0 or more")?;
            wanted.extend(picture.data().iter().map(|&v| v as f32));
            // Beyond a depth of 20, tanh is 1 in every digit.
            before.extend(there.data().iter().map(|&v| v.min(20.0) as f32));
        }
        let mut rollout = Rollout::new(&architecture, wanted, before, Noise::none(&architecture, pictures.len()));
        rollout.run(&Model::new(&self.architecture, &self.parameters), self.gated);
        Ok((0..pictures.len()).map(|k| steps_of(&rollout, k)).collect())
    }

    #[cfg(feature = "train")]
    pub(crate) fn from_parameters(architecture: Architecture, parameters: Vec<f32>, gated: bool) -> Self {
        Self { architecture, parameters, gated }
    }

    #[cfg(feature = "train")]
    pub(crate) fn into_parameters(self) -> Vec<f32> {
        self.parameters
    }
}
