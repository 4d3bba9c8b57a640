//! The state of a training as a file.

use super::adam::Adam;
use crate::error::Error;
use crate::network::safetensors::{self, Storage, Tensor};

/// Names of what a checkpoint holds beside the network.
const MEAN: &str = "adam.mean";
const SQUARE: &str = "adam.square";

/// The state of a training.
pub(super) struct State {
    pub(super) tensors: Vec<Tensor>,
    pub(super) adam: Adam,
    pub(super) steps: usize,
}

impl State {
    /// As the bytes of a safetensors file; `fingerprint`: all that decides on the weights.
    pub(super) fn write(mut self, fingerprint: String) -> Vec<u8> {
        let (mean, square, updates) = self.adam.state();
        for (name, values) in [(MEAN, mean), (SQUARE, square)] {
            self.tensors.push(Tensor { name: name.to_string(), shape: vec![values.len()], values: values.to_vec() });
        }
        let notes = [("settings", fingerprint), ("step", self.steps.to_string()), ("updates", updates.to_string())];
        safetensors::write(&self.tensors, &notes, Storage::Whole)
    }

    /// Refuses the state of another network, or of a training with other settings.
    pub(super) fn read(bytes: &[u8], parameters: usize, fingerprint: &str) -> Result<Self, Error> {
        let (tensors, notes) = safetensors::read(bytes)?;
        let note = |name: &str| notes.iter().find(|(key, _)| key == name).map_or("", |(_, value)| value.as_str());
        let made_with = note("settings");
        if made_with != fingerprint {
            let why = format!("the checkpoint was made with other settings (\"{made_with}\", not \"{fingerprint}\")");
            return Err(Error::Weights(why));
        }
        let whole = |name: &str| {
            note(name).parse::<usize>().map_err(|_| Error::Weights(format!("the checkpoint does not tell its {name}")))
        };
        let moments = |name: &str| {
            let found = tensors.iter().find(|t| t.name == name && t.values.len() == parameters);
            found.map(|t| t.values.clone()).ok_or_else(|| Error::Weights(format!("there is no fitting tensor {name}")))
        };
        let adam = Adam::from_state(moments(MEAN)?, moments(SQUARE)?, whole("updates")?);
        let steps = whole("step")?;
        Ok(Self { tensors, adam, steps })
    }
}
