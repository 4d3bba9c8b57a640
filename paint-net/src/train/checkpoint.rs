use super::adam::Adam;
use super::{TrainSettings, Trainer};
use crate::error::Error;
use crate::network::{Network, Tensor, safetensors};

/// Names of what a checkpoint holds beside the network.
const MEAN: &str = "adam.mean";
const SQUARE: &str = "adam.square";

impl Trainer {
    /// The state of training as the bytes of a safetensors file: going on from it gives the same weights, to the last bit, as
    /// never having stopped.
    pub fn checkpoint(&self) -> Vec<u8> {
        let mut tensors = self.network().tensors();
        let (mean, square, updates) = self.adam.state();
        for (name, values) in [(MEAN, mean), (SQUARE, square)] {
            tensors.push(Tensor { name: name.to_string(), shape: vec![values.len()], values: values.to_vec() });
        }
        let notes = [
            ("settings", fingerprint(&self.settings)),
            ("step", self.step.to_string()),
            ("updates", updates.to_string()),
        ];
        safetensors::write(&tensors, &notes)
    }

    /// Goes on from a checkpoint that was made with the same settings; only the number of threads may differ.
    pub fn resume(settings: TrainSettings, checkpoint: &[u8]) -> Result<Self, Error> {
        let mut trainer = Self::new(settings)?;
        let (tensors, notes) = safetensors::read(checkpoint)?;
        let note = |name: &str| notes.iter().find(|(key, _)| key == name).map_or("", |(_, value)| value.as_str());
        let (made_with, asked_for) = (note("settings"), fingerprint(&trainer.settings));
        if made_with != asked_for {
            let why = format!("the checkpoint was made with other settings (\"{made_with}\", not \"{asked_for}\")");
            return Err(Error::Weights(why));
        }
        let whole = |name: &str| {
            note(name).parse::<usize>().map_err(|_| Error::Weights(format!("the checkpoint does not tell its {name}")))
        };
        let moments = |name: &str| {
            let found = tensors.iter().find(|t| t.name == name && t.values.len() == trainer.parameters.len());
            found.map(|t| t.values.clone()).ok_or_else(|| Error::Weights(format!("there is no fitting tensor {name}")))
        };
        let adam = Adam::from_state(moments(MEAN)?, moments(SQUARE)?, whole("updates")?);
        trainer.parameters = Network::from_tensors(&tensors, Some(trainer.settings.shape))?.into_parameters();
        trainer.step = whole("step")?;
        trainer.adam = adam;
        Ok(trainer)
    }
}

/// All settings that decide on the weights.
fn fingerprint(settings: &TrainSettings) -> String {
    let TrainSettings { seed, steps, batch, side, passes, shape, .. } = settings;
    let TrainSettings { learning_rate, longest_gradient, share_of_early_passes, .. } = settings;
    format!(
        "seed {seed}, {steps} steps of {batch} pictures of {side} px, {passes} passes, {} layers of {} channels, {} stages, \
         rate {learning_rate}, gradient up to {longest_gradient}, early passes {share_of_early_passes}",
        shape.layers, shape.channels, shape.stages
    )
}
