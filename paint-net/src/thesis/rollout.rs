//! Paper IV, algorithm 3, over a batch of pictures.

use super::activations::Activations;
use super::architecture::Architecture;
use super::dense::Dense;
use super::lstm::Lstm;
use super::nonlinearities::{sigmoid, tanh};
use super::read_attention::ReadAttention;
use super::spray::{SprayParameters, SprayStamp};
use super::stop;
use crate::network::Real;

/// The layers, ready to be applied.
#[derive(Debug, Clone)]
pub(crate) struct Model<T> {
    attention: Dense<T>,
    encoder: Dense<T>,
    latent: Dense<T>,
    decoder: Dense<T>,
    paint: Dense<T>,
    spray: Dense<T>,
    stop: Dense<T>,
}

impl<T: Real> Model<T> {
    pub(crate) fn new(architecture: &Architecture, parameters: &[T]) -> Self {
        let layers = architecture.layers();
        let dense = |layer| Dense::new(layer, parameters);
        Self {
            attention: dense(&layers.attention),
            encoder: dense(&layers.encoder),
            latent: dense(&layers.latent),
            decoder: dense(&layers.decoder),
            paint: dense(&layers.paint),
            spray: dense(&layers.spray),
            stop: dense(&layers.stop),
        }
    }
}

/// What is drawn at random, per step and sample. All zero: the network's mean.
#[derive(Debug, Clone)]
pub(crate) struct Noise<T> {
    /// Standard normal, `latent` per sample.
    pub(crate) latent: Activations<T>,
    /// `ln u - ln(1 - u)`, `u` uniform.
    pub(crate) stop: Activations<T>,
}

impl<T: Real> Noise<T> {
    pub(crate) fn none(architecture: &Architecture, batch: usize) -> Self {
        Self {
            latent: Activations::new(architecture.steps, batch, architecture.latent),
            stop: Activations::new(architecture.steps, batch, 1),
        }
    }
}

/// What the loss is made of beside the cross-entropy; the thesis names the terms and does not give their weights.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Objective {
    /// Weight of the divergence of `z`. Default 1 (the thesis); less pays for more detail.
    pub latent: f64,
    /// Weight of the divergence of `z_paint`. Default 1, ours.
    pub stop: f64,
    /// Weight of the change of volume from one step to the next. Default 0.1, ours.
    pub variation: f64,
    /// Logit of painting on, before anything is known. Default -1, ours: at 0, a fair coin, `S_stop` grows by a half per step
    /// and the stop comes after 51 steps whatever the picture.
    pub prior: f64,
    /// Whether `σ(z_paint)` scales the volume. Default true, ours: as algorithm 3 is printed it does not, and then nothing
    /// but the divergence tells the network when to stop.
    pub gated: bool,
}

impl Default for Objective {
    fn default() -> Self {
        Self { latent: 1.0, stop: 1.0, variation: 0.1, prior: -1.0, gated: true }
    }
}

/// Everything that the backward pass needs.
#[derive(Debug, Clone)]
pub(crate) struct Rollout<T> {
    pub(crate) architecture: Architecture,
    pub(crate) batch: usize,
    /// Wanted ink, row by row, a picture per sample.
    pub(crate) wanted: Vec<T>,
    pub(crate) noise: Noise<T>,
    /// Depth of paint, as it is now.
    pub(crate) depth: Vec<T>,
    /// Ink before every step, and after the last.
    pub(crate) ink: Activations<T>,
    pub(crate) attention: Activations<T>,
    pub(crate) encoder: Lstm<T>,
    pub(crate) latent: Activations<T>,
    pub(crate) decoder: Lstm<T>,
    pub(crate) paint: Activations<T>,
    pub(crate) spray: Activations<T>,
    pub(crate) logit: Activations<T>,
    /// Volume as sprayed: gated, and zero after the stop.
    pub(crate) volume: Activations<T>,
    /// `S_stop` before every step.
    pub(crate) stop_sum: Activations<T>,
}

impl<T: Real> Rollout<T> {
    /// `before`: depth of paint that is on the wall already.
    pub(crate) fn new(architecture: &Architecture, wanted: Vec<T>, before: Vec<T>, noise: Noise<T>) -> Self {
        let (steps, batch) = (architecture.steps, wanted.len() / architecture.pixels());
        let rows = |width| Activations::new(steps, batch, width);
        Self {
            architecture: *architecture,
            batch,
            wanted,
            noise,
            depth: before,
            ink: Activations::new(steps + 1, batch, architecture.pixels()),
            attention: rows(5),
            encoder: Lstm::new(steps, batch, architecture.glimpse() + architecture.hidden, architecture.hidden),
            latent: rows(2 * architecture.latent),
            decoder: Lstm::new(steps, batch, architecture.latent, architecture.hidden),
            paint: rows(architecture.paint),
            spray: rows(4),
            logit: rows(1),
            volume: rows(1),
            stop_sum: Activations::new(steps + 1, batch, 1),
        }
    }

    /// Whether sample `k` still paints at step `t`.
    pub(crate) fn paints(&self, t: usize, k: usize) -> bool {
        self.stop_sum.at(t)[k] <= T::of(self.architecture.stop)
    }

    /// All `T` steps.
    pub(crate) fn run(&mut self, model: &Model<T>, gated: bool) {
        let (mut reader, mut stamp) = (ReadAttention::new(&self.architecture), SprayStamp::new(&self.architecture));
        self.show(0);
        for t in 0..self.architecture.steps {
            self.read(t, model, &mut reader); //       x̂ = x - tanh c,  r = read(x, x̂, h_dec)
            self.encoder.step(t, &model.encoder); //   h_enc = RNN([r, h_dec])
            self.sample(t, model); //                  z ~ Q(Z | h_enc)
            self.decoder.step(t, &model.decoder); //   h_dec = RNN(z)
            self.paint(t, model, gated, &mut stamp); // z_paint ~ Q(Z_paint | h_dec), c += paint(h_dec), S += 1 - σ(z_paint)
            self.show(t + 1);
        }
    }

    fn show(&mut self, t: usize) {
        for (ink, &depth) in self.ink.at_mut(t).iter_mut().zip(&self.depth) {
            *ink = tanh(depth);
        }
    }

    fn read(&mut self, t: usize, model: &Model<T>, reader: &mut ReadAttention<T>) {
        let (pixels, glimpse, h) = (self.architecture.pixels(), self.architecture.glimpse(), self.architecture.hidden);
        let state = self.decoder.state.at(t);
        let attention = self.attention.at_mut(t);
        model.attention.apply(state, attention);
        let inputs = self.encoder.inputs.at_mut(t).chunks_exact_mut(glimpse + 2 * h);
        let pictures = self.wanted.chunks_exact(pixels).zip(self.ink.at(t).chunks_exact(pixels));
        let raw = attention.chunks_exact(5).zip(state.chunks_exact(h));
        for ((inputs, (picture, ink)), (raw, state)) in inputs.zip(pictures).zip(raw) {
            let (glimpse, rest) = inputs.split_at_mut(glimpse);
            reader.read(raw, picture, ink, glimpse);
            rest[..h].copy_from_slice(state);
        }
    }

    fn sample(&mut self, t: usize, model: &Model<T>) {
        let (z, h) = (self.architecture.latent, self.architecture.hidden);
        let latent = self.latent.at_mut(t);
        model.latent.apply(self.encoder.state.at(t + 1), latent);
        let inputs = self.decoder.inputs.at_mut(t).chunks_exact_mut(z + h);
        let noise = self.noise.latent.at(t).chunks_exact(z);
        for ((inputs, latent), noise) in inputs.zip(latent.chunks_exact(2 * z)).zip(noise) {
            let (mean, log_deviation) = latent.split_at(z);
            for k in 0..z {
                inputs[k] = mean[k] + log_deviation[k].exp() * noise[k];
            }
        }
    }

    fn paint(&mut self, t: usize, model: &Model<T>, gated: bool, stamp: &mut SprayStamp<T>) {
        let (architecture, state) = (self.architecture, self.decoder.state.at(t + 1));
        model.stop.apply(state, self.logit.at_mut(t));
        let hidden = self.paint.at_mut(t);
        model.paint.apply(state, hidden);
        for x in hidden.iter_mut() {
            *x = x.at_least(T::default());
        }
        model.spray.apply(hidden, self.spray.at_mut(t));
        for k in 0..self.batch {
            let open = self.gate(t, k);
            let paints = self.paints(t, k);
            let (stop_sum, after) = self.stop_sum.pair(t);
            after[k] = stop_sum[k] + T::of(1.0) - open;
            if paints {
                let spray = SprayParameters::new(&architecture, &self.spray.at(t)[4 * k..4 * k + 4]);
                let volume = if gated { open * spray.volume } else { spray.volume };
                self.volume.at_mut(t)[k] = volume;
                stamp.add(&spray, volume, &mut self.depth[k * architecture.pixels()..(k + 1) * architecture.pixels()]);
            }
        }
    }

    /// `z_paint` of a sample.
    pub(crate) fn stop_sample(&self, t: usize, k: usize) -> T {
        stop::sample(self.logit.at(t)[k], self.noise.stop.at(t)[k])
    }

    /// `σ(z_paint)` of a sample.
    pub(crate) fn gate(&self, t: usize, k: usize) -> T {
        sigmoid(self.stop_sample(t, k))
    }
}
