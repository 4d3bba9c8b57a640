//! Training of the feedback network.

use std::convert::Infallible;

use super::descent::{Descent, StepSettings};
use super::sample::Sample;
use crate::error::{Error, require};
use crate::network::{Adjoint, Architecture, Network, PackedNetwork, Unrolled};

/// How the network is trained.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct TrainSettings {
    /// Seed of the first weights and of all pictures. Default 1.
    pub seed: u64,
    /// Steps of the optimiser. Default 12,000, ours.
    pub steps: usize,
    /// Pictures per step. Default 8, ours.
    pub batch: usize,
    /// Side of the pictures, pixels. Default 64, ours.
    pub side: usize,
    /// Feedback passes per picture. Default 8, ours.
    pub passes: usize,
    /// Sizes of the network.
    pub architecture: Architecture,
    /// Learning rate after the first steps, falling to 0 along a cosine. Default 4e-3, ours.
    pub learning_rate: f64,
    /// Gradients longer than this are shortened to it. Default 1, ours.
    pub max_gradient_norm: f64,
    /// Share of the loss after every pass but the last. Default 0.1 (ours).
    pub early_pass_weight: f64,
    /// Threads; the weights do not depend on it. Default 1.
    pub threads: usize,
}

impl Default for TrainSettings {
    fn default() -> Self {
        Self {
            seed: 1,
            steps: 12_000,
            batch: 8,
            side: 64,
            passes: 8,
            architecture: Architecture::default(),
            learning_rate: 4e-3,
            max_gradient_norm: 1.0,
            early_pass_weight: 0.1,
            threads: 1,
        }
    }
}

/// Training under way.
#[derive(Debug, Clone)]
pub struct Trainer {
    settings: TrainSettings,
    descent: Descent,
}

/// What one step of training found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrainProgress {
    /// Steps done.
    pub step: usize,
    /// Mean over the batch of `Σ_k share_k ln(mse_k + 1e-3)`.
    pub loss: f64,
    /// Mean PSNR of the batch after the last pass, dB.
    pub psnr_db: f64,
}

impl Trainer {
    /// Random weights for a seed.
    pub fn new(settings: TrainSettings) -> Result<Self, Error> {
        settings.architecture.check()?;
        let whole =
            |name, value: usize, most: usize, rule| require(name, value as f64, (1..=most).contains(&value), rule);
        whole("steps", settings.steps, 100_000_000, "it must lie in 1..=1e8")?;
        whole("batch", settings.batch, 4096, "it must lie in 1..=4096")?;
        whole("passes", settings.passes, 64, "it must lie in 1..=64")?;
        whole("threads", settings.threads, 1024, "it must lie in 1..=1024")?;
        require("side", settings.side as f64, (16..=1024).contains(&settings.side), "it must lie in 16..=1024")?;
        let rate = settings.learning_rate;
        require("learning_rate", rate, rate > 0.0 && rate <= 1.0, "it must lie in (0, 1]")?;
        let longest = settings.max_gradient_norm;
        require("max_gradient_norm", longest, longest > 0.0, "it must be positive")?;
        let share = settings.early_pass_weight;
        require("early_pass_weight", share, (0.0..=1.0).contains(&share), "it must lie in [0, 1]")?;
        let descent = Descent::new(Network::random(settings.architecture, settings.seed).into_parameters());
        Ok(Self { settings, descent })
    }

    /// The weights as they are.
    pub fn network(&self) -> Network {
        Network::from_parameters(self.settings.architecture, self.descent.parameters.clone())
    }

    /// Steps done.
    pub fn steps_done(&self) -> usize {
        self.descent.steps()
    }

    /// Whether all steps are done.
    pub fn is_done(&self) -> bool {
        self.steps_done() >= self.settings.steps
    }

    /// One step of the optimiser.
    pub fn step(&mut self) -> TrainProgress {
        let settings = &self.settings;
        let step = self.descent.steps();
        let network = PackedNetwork::new(settings.architecture, self.descent.parameters.clone());
        let first = (step * settings.batch) as u64;
        let mut weights = vec![settings.early_pass_weight; settings.passes];
        weights[settings.passes - 1] = 1.0;
        let job = |k: usize, _: &[f32]| {
            let sample = Sample::new(settings.seed, settings.side, first + k as u64);
            let mut unrolled = Unrolled::new(&sample.problem, &network, settings.passes);
            unrolled.forward(&sample.problem, &network, &mut |pass, paint| sample.perturb(pass, paint));
            let errors = unrolled.errors(&sample.problem);
            let mut gradient = vec![0.0; network.parameters().len()];
            let mut adjoint = Adjoint::new(&network, &sample.problem);
            let loss = unrolled.backward(&sample.problem, &network, &weights, &mut adjoint, &mut gradient);
            Ok::<_, Infallible>(((loss, -10.0 * (errors[settings.passes] + 1e-20).log10()), gradient))
        };
        let step_settings = StepSettings {
            threads: settings.threads,
            jobs: settings.batch,
            samples: settings.batch,
            max_gradient_norm: settings.max_gradient_norm,
            learning_rate: rate(settings, step),
        };
        let share = 1.0 / settings.batch as f64;
        let (mut loss, mut psnr_db) = (0.0, 0.0);
        let Ok(()) = self.descent.step(&step_settings, &job, &mut |(one_loss, one_psnr)| {
            loss += share * one_loss;
            psnr_db += share * one_psnr;
        });
        TrainProgress { step: step + 1, loss, psnr_db }
    }

    /// The state of training as the bytes of a safetensors file: going on from it gives the same weights, to the last bit, as
    /// never having stopped.
    pub fn checkpoint(&self) -> Vec<u8> {
        self.descent.checkpoint(self.network().tensors(), fingerprint(&self.settings))
    }

    /// Goes on from a checkpoint that was made with the same settings; only the number of threads may differ.
    pub fn resume(settings: TrainSettings, checkpoint: &[u8]) -> Result<Self, Error> {
        let mut trainer = Self::new(settings)?;
        let (fingerprint, architecture) = (fingerprint(&trainer.settings), trainer.settings.architecture);
        trainer.descent.resume(checkpoint, &fingerprint, |tensors| {
            Network::from_tensors(tensors, Some(architecture)).map(Network::into_parameters)
        })?;
        Ok(trainer)
    }
}

/// Learning rate of a step: up in a line over the first 100, then down along a cosine.
fn rate(settings: &TrainSettings, step: usize) -> f64 {
    let done = step as f64 / settings.steps as f64;
    let cosine = 0.5 * (1.0 + (std::f64::consts::PI * done).cos());
    settings.learning_rate * cosine * ((step + 1) as f64 / 100.0).min(1.0)
}

/// All settings that decide on the weights.
fn fingerprint(settings: &TrainSettings) -> String {
    let TrainSettings { seed, steps, batch, side, passes, architecture, .. } = settings;
    let TrainSettings { learning_rate, max_gradient_norm, early_pass_weight, .. } = settings;
    format!(
        "seed {seed}, {steps} steps of {batch} pictures of {side} px, {passes} passes, {} layers of {} channels, {} stages, \
         rate {learning_rate}, gradient up to {max_gradient_norm}, early passes {early_pass_weight}",
        architecture.layers, architecture.channels, architecture.stages
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_seed_decides_on_weights_and_pictures() {
        let trainer = |seed| {
            let settings = TrainSettings { seed, batch: 2, side: 16, passes: 2, ..TrainSettings::default() };
            Trainer::new(settings).unwrap()
        };
        let (mut one, mut other) = (trainer(1), trainer(2));
        assert!(one.network() != other.network());
        // The same weights on other pictures have another loss.
        other.descent.parameters.clone_from(&one.descent.parameters);
        let [one, other] = [one.step(), other.step()];
        assert!(one.loss != other.loss && one.psnr_db != other.psnr_db, "{one:?}, {other:?}");
    }
}
