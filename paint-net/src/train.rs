//! Training of the feedback painter on procedural pictures, and of the thesis' network on pictures given: seeded, and the same to the last bit for any number of threads.

mod adam;
mod checkpoint;
mod patch;
mod sample;
mod thesis;

use crate::error::{Error, require};
use crate::network::{Adjoint, Block, Network, Shape, Trace};
use adam::{Adam, shorten};
pub use patch::thesis_patch;
use sample::Sample;
pub use thesis::{ThesisLoss, ThesisSettings, ThesisTrainer};

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
    pub shape: Shape,
    /// Learning rate after the first steps, falling to 0 along a cosine. Default 4e-3, ours.
    pub learning_rate: f64,
    /// Gradients longer than this are shortened to it. Default 1, ours.
    pub longest_gradient: f64,
    /// Share of the loss after every pass but the last. Default 0.1 (ours).
    pub share_of_early_passes: f64,
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
            shape: Shape::default(),
            learning_rate: 4e-3,
            longest_gradient: 1.0,
            share_of_early_passes: 0.1,
            threads: 1,
        }
    }
}

/// Training under way.
#[derive(Debug, Clone)]
pub struct Trainer {
    settings: TrainSettings,
    parameters: Vec<f32>,
    adam: Adam,
    step: usize,
}

/// What one step of training found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
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
        settings.shape.check()?;
        let whole =
            |name, value: usize, most: usize, rule| require(name, value as f64, (1..=most).contains(&value), rule);
        whole("steps", settings.steps, 100_000_000, "it must lie in 1..=1e8")?;
        whole("batch", settings.batch, 4096, "it must lie in 1..=4096")?;
        whole("passes", settings.passes, 64, "it must lie in 1..=64")?;
        whole("threads", settings.threads, 1024, "it must lie in 1..=1024")?;
        require("side", settings.side as f64, (16..=1024).contains(&settings.side), "it must lie in 16..=1024")?;
        let rate = settings.learning_rate;
        require("learning_rate", rate, rate > 0.0 && rate <= 1.0, "it must lie in (0, 1]")?;
        let longest = settings.longest_gradient;
        require("longest_gradient", longest, longest > 0.0, "it must be positive")?;
        let share = settings.share_of_early_passes;
        require("share_of_early_passes", share, (0.0..=1.0).contains(&share), "it must lie in [0, 1]")?;
        let parameters = Network::random(settings.shape, settings.seed).into_parameters();
        let adam = Adam::new(parameters.len());
        Ok(Self { settings, parameters, adam, step: 0 })
    }

    /// The weights as they are.
    pub fn network(&self) -> Network {
        Network::from_parameters(self.settings.shape, self.parameters.clone())
    }

    /// Steps done.
    pub fn steps_done(&self) -> usize {
        self.step
    }

    /// Whether all steps are done.
    pub fn is_done(&self) -> bool {
        self.step >= self.settings.steps
    }

    /// One step of the optimiser.
    pub fn step(&mut self) -> Progress {
        let settings = &self.settings;
        let block = Block::new(settings.shape, self.parameters.clone());
        let first = (self.step * settings.batch) as u64;
        let results = in_threads(settings.threads, settings.batch, &|k| {
            let sample = Sample::new(settings, first + k as u64);
            let mut trace = Trace::new(&sample.field, &block, settings.passes);
            trace.forward(&sample.field, &block, &mut |pass, paint| sample.disturb(pass, paint));
            let errors = trace.errors(&sample.field);
            let mut shares = vec![settings.share_of_early_passes; settings.passes];
            shares[settings.passes - 1] = 1.0;
            let mut gradient = vec![0.0; block.parameters().len()];
            let mut adjoint = Adjoint::new(&block, &sample.field);
            let loss = trace.backward(&sample.field, &block, &shares, &mut adjoint, &mut gradient);
            (loss, -10.0 * (errors[settings.passes] + 1e-20).log10(), gradient)
        });
        // Always in the order of the pictures: floating-point sums depend on it.
        let share = 1.0 / settings.batch as f64;
        let mut gradient = vec![0.0_f32; self.parameters.len()];
        let (mut loss, mut psnr_db) = (0.0, 0.0);
        for (one_loss, one_psnr, one) in &results {
            loss += share * one_loss;
            psnr_db += share * one_psnr;
            for (sum, &g) in gradient.iter_mut().zip(one) {
                *sum += g * share as f32;
            }
        }
        if shorten(&mut gradient, settings.longest_gradient) {
            self.adam.step(&mut self.parameters, &gradient, rate(settings, self.step));
        }
        self.step += 1;
        Progress { step: self.step, loss, psnr_db }
    }
}

/// Learning rate of a step: up in a line over the first 100, then down along a cosine.
fn rate(settings: &TrainSettings, step: usize) -> f64 {
    let done = step as f64 / settings.steps as f64;
    let cosine = 0.5 * (1.0 + (std::f64::consts::PI * done).cos());
    settings.learning_rate * cosine * ((step + 1) as f64 / 100.0).min(1.0)
}

/// `job(0..count)` on several threads, results in order.
fn in_threads<R: Send>(threads: usize, count: usize, job: &(dyn Fn(usize) -> R + Sync)) -> Vec<R> {
    let share = count.div_ceil(threads);
    if threads == 1 || count == 1 {
        return (0..count).map(job).collect();
    }
    let mut results: Vec<Option<R>> = (0..count).map(|_| None).collect();
    std::thread::scope(|scope| {
        for (t, results) in results.chunks_mut(share).enumerate() {
            scope.spawn(move || {
                for (k, result) in results.iter_mut().enumerate() {
                    *result = Some(job(t * share + k));
                }
            });
        }
    });
    results.into_iter().flatten().collect()
}
