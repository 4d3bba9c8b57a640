//! The loop that both trainers share: gradients of many samples, their mean, Adam, and checkpoints.

use super::adam::{Adam, clip_norm};
use super::checkpoint::State;
use crate::error::Error;
use crate::network::safetensors::Tensor;

/// Parameters under training.
#[derive(Debug, Clone)]
pub(super) struct Descent {
    pub(super) parameters: Vec<f32>,
    adam: Adam,
    steps: usize,
}

/// How one step is taken.
pub(super) struct StepSettings {
    pub(super) threads: usize,
    /// Number of jobs, and samples in all of them.
    pub(super) jobs: usize,
    pub(super) samples: usize,
    /// Longer gradients are shortened to this.
    pub(super) max_gradient_norm: f64,
    pub(super) learning_rate: f64,
}

/// From the number of a job and the parameters to the figures of its samples and the sum of their gradients.
type Job<'a, R, E> = dyn Fn(usize, &[f32]) -> Result<(R, Vec<f32>), E> + Sync + 'a;

impl Descent {
    pub(super) fn new(parameters: Vec<f32>) -> Self {
        Self { adam: Adam::new(parameters.len()), parameters, steps: 0 }
    }

    /// Steps done.
    pub(super) fn steps(&self) -> usize {
        self.steps
    }

    /// One step against the mean gradient of all samples. The figures are
    /// collected in the order of the jobs. If a job fails, nothing changes.
    pub(super) fn step<R: Send, E: Send>(
        &mut self,
        settings: &StepSettings,
        job: &Job<R, E>,
        collect: &mut dyn FnMut(R),
    ) -> Result<(), E> {
        let parameters = &self.parameters;
        let results = parallel_map(settings.threads, settings.jobs, &|k| job(k, parameters));
        // Always in the order of the jobs: floating-point sums depend on it.
        let share = 1.0 / settings.samples as f64;
        let mut gradient = vec![0.0_f32; parameters.len()];
        for result in results {
            let (figures, one) = result?;
            collect(figures);
            for (sum, g) in gradient.iter_mut().zip(one) {
                *sum += g * share as f32;
            }
        }
        if clip_norm(&mut gradient, settings.max_gradient_norm) {
            self.adam.step(&mut self.parameters, &gradient, settings.learning_rate);
        }
        self.steps += 1;
        Ok(())
    }

    /// The state as the bytes of a safetensors file: the network's tensors, Adam's moments, and `fingerprint`, which names all
    /// settings that decide on the parameters.
    pub(super) fn checkpoint(&self, tensors: Vec<Tensor>, fingerprint: String) -> Vec<u8> {
        State { tensors, adam: self.adam.clone(), steps: self.steps }.write(fingerprint)
    }

    /// Goes on from a checkpoint of the same fingerprint; `parameters` finds them among its tensors.
    pub(super) fn resume(
        &mut self,
        checkpoint: &[u8],
        fingerprint: &str,
        parameters: impl FnOnce(&[Tensor]) -> Result<Vec<f32>, Error>,
    ) -> Result<(), Error> {
        let State { tensors, adam, steps } = State::read(checkpoint, self.parameters.len(), fingerprint)?;
        *self = Self { parameters: parameters(&tensors)?, adam, steps };
        Ok(())
    }
}

/// `job(0..count)` on several threads, results in order.
pub(super) fn parallel_map<R: Send>(threads: usize, count: usize, job: &(dyn Fn(usize) -> R + Sync)) -> Vec<R> {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_goes_against_the_mean_of_all_samples() {
        // Four samples in two jobs: mean gradients of 1, then of 10, neither longer than what is let through.
        let settings = StepSettings { threads: 1, jobs: 2, samples: 4, max_gradient_norm: 10.5, learning_rate: 0.5 };
        let mut descent = Descent::new(vec![0.0]);
        for mean in [1.0, 10.0] {
            let job = |_: usize, _: &[f32]| Ok::<_, ()>(((), vec![2.0 * mean]));
            descent.step(&settings, &job, &mut |()| ()).unwrap();
        }
        // Adam by hand: the first step is the rate; the second has these means.
        let (mean, square): (f64, f64) = ((0.09 + 1.0) / (1.0 - 0.81), (0.000_999 + 0.1) / (1.0 - 0.998_001));
        let expected = -0.5 * (1.0 + mean / square.sqrt());
        assert!((f64::from(descent.parameters[0]) - expected).abs() < 1e-5, "{} {expected}", descent.parameters[0]);
    }
}
