//! Training of the thesis' network (Paper IV, section 3.3), on pictures that the caller gives.

use super::descent::{Descent, StepSettings, parallel_map};
use crate::error::{Error, require};
use crate::image::Image;
use crate::procedural::lattice;
use crate::thesis::{
    Architecture, LossTerms, Model, ModelAdjoint, Network, Noise, Objective, Rollout, backward, loss_terms,
};

/// How the thesis' network is trained.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct ThesisSettings {
    /// Seed of the first weights and of all noise. Default 1.
    pub seed: u64,
    /// Sizes of the network. Default [`Architecture::MNIST`].
    pub architecture: Architecture,
    /// Steps of the optimiser. Default 7000 (100 epochs of 7000 pictures), ours.
    pub steps: usize,
    /// Pictures per step. Default 100 (as in figure 8.7).
    pub batch: usize,
    /// First learning rate. Default 1e-4 (section 3.3).
    pub learning_rate: f64,
    /// Last learning rate; in between it falls exponentially. Default 1e-7 (section 3.3).
    pub last_learning_rate: f64,
    /// Gradients longer than this are shortened to it. Default 10, ours.
    pub max_gradient_norm: f64,
    /// Weights of the terms of the loss.
    pub objective: Objective,
    /// Threads; the weights do not depend on it. Default 1.
    pub threads: usize,
}

impl Default for ThesisSettings {
    fn default() -> Self {
        Self {
            seed: 1,
            architecture: Architecture::MNIST,
            steps: 7000,
            batch: 100,
            learning_rate: 1e-4,
            last_learning_rate: 1e-7,
            max_gradient_norm: 10.0,
            objective: Objective::default(),
            threads: 1,
        }
    }
}

/// Pictures that are worked on together, whatever the number of threads: sums depend on it.
const CHUNK: usize = 25;

/// Means over a batch of pictures, nats per picture.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ThesisLoss {
    /// The whole loss.
    pub total: f64,
    /// Cross-entropy between `ε + (1 - 2ε) tanh c` and the picture, `ε` = 0.001.
    pub cross_entropy: f64,
    /// Divergence of the latent code from a standard normal, all steps together.
    pub latent: f64,
    /// Divergence of `z_paint` from its prior, before its weight.
    pub stop: f64,
    /// `Σ |v_t - v_{t-1}|`, before its weight.
    pub variation: f64,
    /// Steps up to the stop.
    pub steps: f64,
}

/// Training under way.
#[derive(Debug, Clone)]
pub struct ThesisTrainer {
    settings: ThesisSettings,
    descent: Descent,
}

impl ThesisTrainer {
    /// Random weights for a seed.
    pub fn new(settings: ThesisSettings) -> Result<Self, Error> {
        let whole =
            |name, value: usize, most: usize, rule| require(name, value as f64, (1..=most).contains(&value), rule);
        whole("steps", settings.steps, 100_000_000, "it must lie in 1..=1e8")?;
        whole("batch", settings.batch, 4096, "it must lie in 1..=4096")?;
        whole("threads", settings.threads, 1024, "it must lie in 1..=1024")?;
        for (name, rate) in
            [("learning_rate", settings.learning_rate), ("last_learning_rate", settings.last_learning_rate)]
        {
            require(name, rate, rate > 0.0 && rate <= 1.0, "it must lie in (0, 1]")?;
        }
        let longest = settings.max_gradient_norm;
        require("max_gradient_norm", longest, longest > 0.0, "it must be positive")?;
        let Objective { latent, stop, variation, prior, .. } = settings.objective;
        for (name, weight) in
            [("objective.latent", latent), ("objective.stop", stop), ("objective.variation", variation)]
        {
            require(name, weight, (0.0..=1e6).contains(&weight), "it must lie in [0, 1e6]")?;
        }
        require("objective.prior", prior, prior.abs() <= 50.0, "it must lie in [-50, 50]")?;
        let descent = Descent::new(Network::random(settings.architecture, settings.seed)?.into_parameters());
        Ok(Self { settings, descent })
    }

    /// The weights as they are.
    pub fn network(&self) -> Network {
        let ThesisSettings { architecture, objective, .. } = self.settings;
        Network::from_parameters(architecture, self.descent.parameters.clone(), objective.gated)
    }

    /// Steps done.
    pub fn steps_done(&self) -> usize {
        self.descent.steps()
    }

    /// One step of the optimiser. `picture` gives the ink of the `n`th sample since the start of training, `side` x `side`
    /// pixels in `[0, 1]`, the same at every call.
    pub fn step(&mut self, picture: &(dyn Fn(u64) -> Result<Image, Error> + Sync)) -> Result<ThesisLoss, Error> {
        let (settings, step) = (&self.settings, self.descent.steps());
        let first = (step * settings.batch) as u64;
        let adjoint = ModelAdjoint::new(&settings.architecture, &self.descent.parameters);
        let model = Model::new(&settings.architecture, &self.descent.parameters);
        let job = |chunk: usize, parameters: &[f32]| {
            let numbers = chunk * CHUNK..settings.batch.min((chunk + 1) * CHUNK);
            let samples: Vec<u64> = numbers.map(|k| first + k as u64).collect();
            let pictures: Vec<Image> = samples.iter().map(|&n| picture(n)).collect::<Result<_, _>>()?;
            let mut rollout = prepare(settings, &pictures.iter().collect::<Vec<_>>(), &samples)?;
            rollout.run(&model, settings.objective.gated);
            let found = (loss_terms(&rollout, settings.objective.prior), steps_used(&rollout));
            let mut gradient = vec![0.0; parameters.len()];
            backward(&mut rollout, &adjoint, &settings.objective, &mut gradient);
            Ok((found, gradient))
        };
        let falling = (settings.last_learning_rate / settings.learning_rate).powf(step as f64 / settings.steps as f64);
        let step_settings = StepSettings {
            threads: settings.threads,
            jobs: settings.batch.div_ceil(CHUNK),
            samples: settings.batch,
            max_gradient_norm: settings.max_gradient_norm,
            learning_rate: settings.learning_rate * falling,
        };
        let mut sums = Sums::default();
        self.descent.step(&step_settings, &job, &mut |found| sums.add(found))?;
        Ok(sums.means(&self.settings.objective, self.settings.batch))
    }

    /// The loss on pictures that are not trained on, with noise that is the same at every call.
    pub fn validate(&self, pictures: &[Image]) -> Result<ThesisLoss, Error> {
        let model = Model::new(&self.settings.architecture, &self.descent.parameters);
        let mut sums = Sums::default();
        let chunks: Vec<&[Image]> = pictures.chunks(CHUNK).collect();
        for result in parallel_map(self.settings.threads, chunks.len().max(1), &|chunk| {
            let Some(pictures) = chunks.get(chunk) else { return Err(Error::EmptyProblem("there is no picture")) };
            // Numbers that no training reaches.
            let samples: Vec<u64> = (0..pictures.len()).map(|k| (1 << 50) + (chunk * CHUNK + k) as u64).collect();
            let mut rollout = prepare(&self.settings, &pictures.iter().collect::<Vec<_>>(), &samples)?;
            rollout.run(&model, self.settings.objective.gated);
            Ok((loss_terms(&rollout, self.settings.objective.prior), steps_used(&rollout)))
        }) {
            sums.add(result?);
        }
        Ok(sums.means(&self.settings.objective, pictures.len()))
    }

    /// The state of training as the bytes of a safetensors file: going on from it gives the same weights, to the last bit, as
    /// never having stopped.
    pub fn checkpoint(&self) -> Vec<u8> {
        self.descent.checkpoint(self.network().tensors(), fingerprint(&self.settings))
    }

    /// Goes on from a checkpoint that was made with the same settings; only the number of threads may differ.
    pub fn resume(settings: ThesisSettings, checkpoint: &[u8]) -> Result<Self, Error> {
        let mut trainer = Self::new(settings)?;
        let fingerprint = fingerprint(&trainer.settings);
        trainer
            .descent
            .resume(checkpoint, &fingerprint, |tensors| Network::from_tensors(tensors).map(Network::into_parameters))?;
        Ok(trainer)
    }
}

#[derive(Default)]
struct Sums {
    terms: LossTerms,
    steps: usize,
}

impl Sums {
    fn add(&mut self, (terms, steps): (LossTerms, usize)) {
        self.terms.cross_entropy += terms.cross_entropy;
        self.terms.latent += terms.latent;
        self.terms.stop += terms.stop;
        self.terms.variation += terms.variation;
        self.steps += steps;
    }

    fn means(&self, objective: &Objective, count: usize) -> ThesisLoss {
        let share = 1.0 / count as f64;
        ThesisLoss {
            total: share * self.terms.total(objective),
            cross_entropy: share * self.terms.cross_entropy,
            latent: share * self.terms.latent,
            stop: share * self.terms.stop,
            variation: share * self.terms.variation,
            steps: share * self.steps as f64,
        }
    }
}

fn steps_used(rollout: &Rollout<f32>) -> usize {
    (0..rollout.batch).map(|k| (0..rollout.architecture.steps).filter(|&t| rollout.paints(t, k)).count()).sum()
}

/// A batch on a bare wall, with the noise that belongs to its samples.
fn prepare(settings: &ThesisSettings, pictures: &[&Image], samples: &[u64]) -> Result<Rollout<f32>, Error> {
    let architecture = &settings.architecture;
    let expected = (architecture.side, architecture.side);
    let mut wanted = Vec::with_capacity(pictures.len() * architecture.pixels());
    for picture in pictures {
        if picture.size() != expected {
            return Err(Error::Mismatch { what: "picture", found: picture.size(), expected });
        }
        picture.check_range("picture", 0.0, 1.0, "ink in [0, 1]")?;
        wanted.extend(picture.data().iter().map(|&v| v as f32));
    }
    let mut noise = Noise::none(architecture, pictures.len());
    for t in 0..architecture.steps {
        for (row, &n) in noise.latent.at_mut(t).chunks_exact_mut(architecture.latent).zip(samples) {
            let draw = |k: usize, which: i64| uniform(settings.seed, n, (t * architecture.latent + k) as i64, which);
            for (k, pair) in row.chunks_mut(2).enumerate() {
                // Two normal numbers from two uniform ones (Box and Muller 1958).
                let (length, angle) = ((-2.0 * draw(k, 1).ln()).sqrt(), std::f64::consts::TAU * draw(k, 2));
                pair[0] = (length * angle.cos()) as f32;
                if let Some(second) = pair.get_mut(1) {
                    *second = (length * angle.sin()) as f32;
                }
            }
        }
        for (v, &n) in noise.stop.at_mut(t).iter_mut().zip(samples) {
            let u = uniform(settings.seed, n, t as i64, 3);
            *v = (u / (1.0 - u)).ln() as f32;
        }
    }
    let before = vec![0.0; wanted.len()];
    Ok(Rollout::new(architecture, wanted, before, noise))
}

/// In `[1e-6, 1 - 1e-6]`.
fn uniform(seed: u64, sample: u64, k: i64, which: i64) -> f64 {
    let stream = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ sample.wrapping_mul(0xD134_2543_DE82_EF95);
    lattice(stream, k, which).clamp(1e-6, 1.0 - 1e-6)
}

/// All settings that decide on the weights.
fn fingerprint(settings: &ThesisSettings) -> String {
    let ThesisSettings { threads: _, seed, architecture, steps, batch, learning_rate, last_learning_rate, .. } =
        settings;
    let ThesisSettings { max_gradient_norm, objective, .. } = settings;
    format!(
        "seed {seed}, {steps} steps of {batch} pictures, rate {learning_rate} to {last_learning_rate}, gradient up to \
         {max_gradient_norm}, {architecture:?}, {objective:?}"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_seed_decides_on_weights_and_noise() {
        let architecture =
            Architecture { side: 8, steps: 4, latent: 3, hidden: 5, read: 2, radius: 3.0, stop: 3.0, paint: 4 };
        let trainer = |seed| {
            ThesisTrainer::new(ThesisSettings { seed, architecture, batch: 2, ..ThesisSettings::default() }).unwrap()
        };
        let picture = |_| Ok(Image::filled(8, 8, 0.5));
        let (mut one, mut other) = (trainer(1), trainer(2));
        assert!(one.network() != other.network());
        // The same weights on the same pictures with other noise have another loss.
        other.descent.parameters.clone_from(&one.descent.parameters);
        assert!(one.step(&picture).unwrap().total != other.step(&picture).unwrap().total);
    }

    #[test]
    fn noise_is_normal_and_new_for_every_step_number_and_sample() {
        let architecture =
            Architecture { side: 4, steps: 40, latent: 25, hidden: 5, read: 2, radius: 3.0, stop: 3.0, paint: 4 };
        let settings = ThesisSettings { seed: 5, architecture, batch: 10, ..ThesisSettings::default() };
        let picture = Image::filled(4, 4, 0.5);
        let samples: Vec<u64> = (0..10).collect();
        let rollout = prepare(&settings, &[&picture; 10], &samples).unwrap();
        let drawn: Vec<f64> = (0..40)
            .flat_map(|t| rollout.noise.latent.at(t).iter().map(|&v| f64::from(v)).collect::<Vec<_>>())
            .collect();
        let count = drawn.len() as f64;
        let moment = |power: i32| drawn.iter().map(|v| v.powi(power)).sum::<f64>() / count;
        // Of 10,000 normal numbers; five deviations of each mean.
        assert_eq!(drawn.len(), 10_000);
        assert!(moment(1).abs() < 0.05 && (moment(2) - 1.0).abs() < 0.071 && (moment(4) - 3.0).abs() < 0.49);
        let mut bits: Vec<u64> = drawn.iter().map(|v| v.to_bits()).collect();
        bits.sort_unstable();
        bits.dedup();
        // Of so many of single precision hardly any agree by chance.
        assert!(drawn.len() - bits.len() < 20, "{} are there twice", drawn.len() - bits.len());
    }
}
