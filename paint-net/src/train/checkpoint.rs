use super::adam::Adam;
use super::{TrainSettings, Trainer};
use crate::error::Error;
use crate::network::{Network, Tensor, safetensors};

/// Names of what a checkpoint holds beside the network.
const MEAN: &str = "adam.mean";
const SQUARE: &str = "adam.square";

/// The state of a training.
pub(super) struct State {
    pub(super) tensors: Vec<Tensor>,
    pub(super) adam: Adam,
    pub(super) step: usize,
}

impl State {
    /// As the bytes of a safetensors file; `settings`: all that decides on the weights.
    pub(super) fn write(mut self, settings: String) -> Vec<u8> {
        let (mean, square, updates) = self.adam.state();
        for (name, values) in [(MEAN, mean), (SQUARE, square)] {
            self.tensors.push(Tensor { name: name.to_string(), shape: vec![values.len()], values: values.to_vec() });
        }
        let notes = [("settings", settings), ("step", self.step.to_string()), ("updates", updates.to_string())];
        safetensors::write(&self.tensors, &notes)
    }

    /// Refuses the state of another network, or of a training with other settings.
    pub(super) fn read(bytes: &[u8], parameters: usize, settings: &str) -> Result<Self, Error> {
        let (tensors, notes) = safetensors::read(bytes)?;
        let note = |name: &str| notes.iter().find(|(key, _)| key == name).map_or("", |(_, value)| value.as_str());
        let made_with = note("settings");
        if made_with != settings {
            let why = format!("the checkpoint was made with other settings (\"{made_with}\", not \"{settings}\")");
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
        let step = whole("step")?;
        Ok(Self { tensors, adam, step })
    }
}

impl Trainer {
    /// The state of training as the bytes of a safetensors file: going on from it gives the same weights, to the last bit, as
    /// never having stopped.
    pub fn checkpoint(&self) -> Vec<u8> {
        let state = State { tensors: self.network().tensors(), adam: self.adam.clone(), step: self.step };
        state.write(fingerprint(&self.settings))
    }

    /// Goes on from a checkpoint that was made with the same settings; only the number of threads may differ.
    pub fn resume(settings: TrainSettings, checkpoint: &[u8]) -> Result<Self, Error> {
        let mut trainer = Self::new(settings)?;
        let state = State::read(checkpoint, trainer.parameters.len(), &fingerprint(&trainer.settings))?;
        trainer.parameters = Network::from_tensors(&state.tensors, Some(trainer.settings.shape))?.into_parameters();
        trainer.step = state.step;
        trainer.adam = state.adam;
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
