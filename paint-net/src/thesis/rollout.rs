//! Paper IV, algorithm 3, over a batch of pictures.

use super::dense::Dense;
use super::functions::{sigmoid, tanh};
use super::lstm::Lstm;
use super::read::Reader;
use super::rows::Rows;
use super::shape::Shape;
use super::spray::{Aim, Stamp};
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
    pub(crate) fn new(shape: &Shape, parameters: &[T]) -> Self {
        let layers = shape.layers();
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
    pub(crate) latent: Rows<T>,
    /// `ln u - ln(1 - u)`, `u` uniform.
    pub(crate) stop: Rows<T>,
}

impl<T: Real> Noise<T> {
    pub(crate) fn none(shape: &Shape, batch: usize) -> Self {
        Self { latent: Rows::new(shape.steps, batch, shape.latent), stop: Rows::new(shape.steps, batch, 1) }
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

/// Sums over the batch, in nats.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Terms {
    pub(crate) cross_entropy: f64,
    pub(crate) latent: f64,
    pub(crate) stop: f64,
    pub(crate) variation: f64,
}

impl Terms {
    pub(crate) fn total(&self, objective: &Objective) -> f64 {
        self.cross_entropy
            + objective.latent * self.latent
            + objective.stop * self.stop
            + objective.variation * self.variation
    }
}

/// Everything that the way back needs.
#[derive(Debug, Clone)]
pub(crate) struct Rollout<T> {
    pub(crate) shape: Shape,
    pub(crate) batch: usize,
    /// Wanted ink, row by row, a picture per sample.
    pub(crate) wanted: Vec<T>,
    pub(crate) noise: Noise<T>,
    /// Depth of paint, as it is now.
    pub(crate) depth: Vec<T>,
    /// Ink before every step, and after the last.
    pub(crate) ink: Rows<T>,
    pub(crate) attention: Rows<T>,
    pub(crate) encoder: Lstm<T>,
    pub(crate) latent: Rows<T>,
    pub(crate) decoder: Lstm<T>,
    pub(crate) paint: Rows<T>,
    pub(crate) spray: Rows<T>,
    pub(crate) logit: Rows<T>,
    /// Volume as sprayed: gated, and zero after the stop.
    pub(crate) volume: Rows<T>,
    /// `S_stop` before every step.
    pub(crate) spent: Rows<T>,
}

impl<T: Real> Rollout<T> {
    /// `before`: depth of paint that is on the wall already.
    pub(crate) fn new(shape: &Shape, wanted: Vec<T>, before: Vec<T>, noise: Noise<T>) -> Self {
        let (steps, batch) = (shape.steps, wanted.len() / shape.pixels());
        let rows = |width| Rows::new(steps, batch, width);
        Self {
            shape: *shape,
            batch,
            wanted,
            noise,
            depth: before,
            ink: Rows::new(steps + 1, batch, shape.pixels()),
            attention: rows(5),
            encoder: Lstm::new(steps, batch, shape.glimpse() + shape.hidden, shape.hidden),
            latent: rows(2 * shape.latent),
            decoder: Lstm::new(steps, batch, shape.latent, shape.hidden),
            paint: rows(shape.paint),
            spray: rows(4),
            logit: rows(1),
            volume: rows(1),
            spent: Rows::new(steps + 1, batch, 1),
        }
    }

    /// Whether sample `k` still paints at step `t`.
    pub(crate) fn paints(&self, t: usize, k: usize) -> bool {
        self.spent.at(t)[k] <= T::of(self.shape.stop)
    }

    /// All `T` steps.
    pub(crate) fn run(&mut self, model: &Model<T>, gated: bool) {
        let (mut reader, mut stamp) = (Reader::new(&self.shape), Stamp::new(&self.shape));
        self.show(0);
        for t in 0..self.shape.steps {
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

    fn read(&mut self, t: usize, model: &Model<T>, reader: &mut Reader<T>) {
        let (pixels, glimpse, h) = (self.shape.pixels(), self.shape.glimpse(), self.shape.hidden);
        let state = self.decoder.state.at(t);
        let attention = self.attention.at_mut(t);
        model.attention.apply(state, attention);
        let inputs = self.encoder.inputs.at_mut(t).chunks_exact_mut(glimpse + 2 * h);
        let pictures = self.wanted.chunks_exact(pixels).zip(self.ink.at(t).chunks_exact(pixels));
        let asked = attention.chunks_exact(5).zip(state.chunks_exact(h));
        for ((inputs, (picture, ink)), (asked, state)) in inputs.zip(pictures).zip(asked) {
            let (glance, rest) = inputs.split_at_mut(glimpse);
            reader.read(asked, picture, ink, glance);
            rest[..h].copy_from_slice(state);
        }
    }

    fn sample(&mut self, t: usize, model: &Model<T>) {
        let (z, h) = (self.shape.latent, self.shape.hidden);
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

    fn paint(&mut self, t: usize, model: &Model<T>, gated: bool, stamp: &mut Stamp<T>) {
        let (shape, state) = (self.shape, self.decoder.state.at(t + 1));
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
            let (spent, after) = self.spent.pair(t);
            after[k] = spent[k] + T::of(1.0) - open;
            if paints {
                let aim = Aim::new(&shape, &self.spray.at(t)[4 * k..4 * k + 4]);
                let volume = if gated { open * aim.volume } else { aim.volume };
                self.volume.at_mut(t)[k] = volume;
                stamp.add(&aim, volume, &mut self.depth[k * shape.pixels()..(k + 1) * shape.pixels()]);
            }
        }
    }

    /// `z_paint` of a sample.
    pub(crate) fn decision(&self, t: usize, k: usize) -> T {
        stop::sample(self.logit.at(t)[k], self.noise.stop.at(t)[k])
    }

    /// `σ(z_paint)` of a sample.
    pub(crate) fn gate(&self, t: usize, k: usize) -> T {
        sigmoid(self.decision(t, k))
    }

    /// The loss, term by term.
    pub(crate) fn terms(&self, prior: f64) -> Terms {
        let mut terms = Terms::default();
        let steps = self.shape.steps;
        for (&ink, &wanted) in self.ink.at(steps).iter().zip(&self.wanted) {
            let (shown, wanted) = (floored(ink).wide(), wanted.wide());
            terms.cross_entropy -= wanted * shown.ln() + (1.0 - wanted) * (1.0 - shown).ln();
        }
        for t in 0..steps {
            for latent in self.latent.at(t).chunks_exact(2 * self.shape.latent) {
                let (mean, log_deviation) = latent.split_at(self.shape.latent);
                for (m, l) in mean.iter().zip(log_deviation) {
                    let (m, l) = (m.wide(), l.wide());
                    terms.latent += 0.5 * (m * m + (2.0 * l).exp() - 2.0 * l - 1.0);
                }
            }
            for k in 0..self.batch {
                terms.stop += stop::divergence(self.decision(t, k), self.logit.at(t)[k], T::of(prior)).wide();
                if t > 0 {
                    terms.variation += (self.volume.at(t)[k].wide() - self.volume.at(t - 1)[k].wide()).abs();
                }
            }
        }
        terms
    }
}

/// Ink never reaches 0 or 1 in the cross-entropy, or a bare wall would cost infinitely much.
pub(crate) const FLOOR: f64 = 1e-3;

/// `ε + (1 - 2ε) a`.
pub(crate) fn floored<T: Real>(ink: T) -> T {
    T::of(FLOOR) + T::of(1.0 - 2.0 * FLOOR) * ink
}
