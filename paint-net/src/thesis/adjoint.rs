//! The way back through algorithm 3, by hand: every function here is the adjoint of one in `rollout.rs`, in reverse order.

use super::dense::DenseAdjoint;
use super::functions::sigmoid;
use super::read::Reader;
use super::rollout::{FLOOR, Objective, Rollout, floored};
use super::rows::Rows;
use super::shape::Shape;
use super::spray::{Aim, Stamp};
use super::stop;
use crate::network::Real;

/// The layers, ready for the way back.
#[derive(Debug, Clone)]
pub(crate) struct ModelAdjoint<T> {
    attention: DenseAdjoint<T>,
    encoder: DenseAdjoint<T>,
    latent: DenseAdjoint<T>,
    decoder: DenseAdjoint<T>,
    paint: DenseAdjoint<T>,
    spray: DenseAdjoint<T>,
    stop: DenseAdjoint<T>,
}

impl<T: Real> ModelAdjoint<T> {
    pub(crate) fn new(shape: &Shape, parameters: &[T]) -> Self {
        let layers = shape.layers();
        let dense = |layer| DenseAdjoint::new(layer, parameters);
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

/// Derivatives by what goes from step to step, and by the outputs of the layers in all steps.
struct Back<T> {
    depth: Vec<T>,
    encoder_memory: Vec<T>,
    encoder_state: Vec<T>,
    decoder_memory: Vec<T>,
    decoder_state: Vec<T>,
    encoder_inputs: Vec<T>,
    decoder_inputs: Vec<T>,
    attention: Rows<T>,
    latent: Rows<T>,
    paint: Rows<T>,
    spray: Rows<T>,
    logit: Rows<T>,
}

impl<T: Real> Back<T> {
    fn new(shape: &Shape, batch: usize) -> Self {
        let state = || vec![T::default(); batch * shape.hidden];
        let rows = |width| Rows::new(shape.steps, batch, width);
        Self {
            depth: vec![T::default(); batch * shape.pixels()],
            encoder_memory: state(),
            encoder_state: state(),
            decoder_memory: state(),
            decoder_state: state(),
            encoder_inputs: vec![T::default(); batch * (shape.glimpse() + 2 * shape.hidden)],
            decoder_inputs: vec![T::default(); batch * (shape.latent + shape.hidden)],
            attention: rows(5),
            latent: rows(2 * shape.latent),
            paint: rows(shape.paint),
            spray: rows(4),
            logit: rows(1),
        }
    }
}

impl<T: Real> Rollout<T> {
    /// Adds the derivatives of the loss, summed over the batch, to `gradient`. What the recurrent layers remember of their
    /// gates is overwritten.
    pub(crate) fn back(&mut self, model: &ModelAdjoint<T>, objective: &Objective, gradient: &mut [T]) {
        let (mut reader, mut stamp) = (Reader::new(&self.shape), Stamp::new(&self.shape));
        let mut d = Back::new(&self.shape, self.batch);
        let steps = self.shape.steps;
        self.cross_entropy_back(&mut d.depth);
        for t in (0..steps).rev() {
            self.paint_back(t, model, objective, &mut stamp, &mut d);
            self.decoder.back(t, &model.decoder, &mut d.decoder_memory, &d.decoder_state, &mut d.decoder_inputs);
            self.sample_back(t, T::of(objective.latent), model, &mut d);
            self.encoder.back(t, &model.encoder, &mut d.encoder_memory, &d.encoder_state, &mut d.encoder_inputs);
            self.read_back(t, model, &mut reader, &mut d);
        }
        let (encoder, decoder) = (&self.encoder.state, &self.decoder.state);
        model.attention.add_weights(decoder.steps(0..steps), d.attention.steps(0..steps), gradient);
        self.encoder.add_weights(&model.encoder, steps, gradient);
        model.latent.add_weights(encoder.steps(1..steps + 1), d.latent.steps(0..steps), gradient);
        self.decoder.add_weights(&model.decoder, steps, gradient);
        model.paint.add_weights(decoder.steps(1..steps + 1), d.paint.steps(0..steps), gradient);
        model.spray.add_weights(self.paint.steps(0..steps), d.spray.steps(0..steps), gradient);
        model.stop.add_weights(decoder.steps(1..steps + 1), d.logit.steps(0..steps), gradient);
    }

    fn cross_entropy_back(&self, depth: &mut [T]) {
        let (one, scale) = (T::of(1.0), T::of(1.0 - 2.0 * FLOOR));
        for ((d, &ink), &wanted) in depth.iter_mut().zip(self.ink.at(self.shape.steps)).zip(&self.wanted) {
            let shown = floored(ink);
            *d = scale * (one - ink * ink) * (shown - wanted) / (shown * (one - shown));
        }
    }

    /// Adds to the derivative by the decoder's state.
    fn paint_back(
        &self,
        t: usize,
        model: &ModelAdjoint<T>,
        objective: &Objective,
        stamp: &mut Stamp<T>,
        d: &mut Back<T>,
    ) {
        let (shape, one) = (self.shape, T::of(1.0));
        let (pixels, prior) = (shape.pixels(), T::of(objective.prior));
        for k in 0..self.batch {
            let decision = self.decision(t, k);
            let mut d_logit = T::of(objective.stop) * stop::divergence_slope(decision, prior);
            if self.paints(t, k) {
                let asked = &self.spray.at(t)[4 * k..4 * k + 4];
                let aim = Aim::new(&shape, asked);
                let sprayed = self.volume.at(t)[k];
                let [x, y, sigma, mut volume] = stamp.back(&aim, sprayed, &d.depth[k * pixels..(k + 1) * pixels]);
                volume += T::of(objective.variation) * self.variation_slope(t, k);
                if objective.gated {
                    let open = sigmoid(decision);
                    d_logit += volume * aim.volume * open * (one - open);
                    volume = volume * open;
                }
                Aim::back(&shape, asked, [x, y, sigma, volume], &mut d.spray.at_mut(t)[4 * k..4 * k + 4]);
            }
            d.logit.at_mut(t)[k] = d_logit;
        }
        let hidden = d.paint.at_mut(t);
        model.spray.add_inputs(d.spray.at(t), hidden);
        for (d, &x) in hidden.iter_mut().zip(self.paint.at(t)) {
            if x <= T::default() {
                *d = T::default();
            }
        }
        model.paint.add_inputs(hidden, &mut d.decoder_state);
        model.stop.add_inputs(d.logit.at(t), &mut d.decoder_state);
    }

    /// Of `Σ_t |v_t - v_{t-1}|` by `v_t`.
    fn variation_slope(&self, t: usize, k: usize) -> T {
        let volume = |t: usize| self.volume.at(t)[k];
        let rise = |t: usize| {
            if t == 0 || t == self.shape.steps || volume(t) == volume(t - 1) {
                T::default()
            } else if volume(t) > volume(t - 1) {
                T::of(1.0)
            } else {
                T::of(-1.0)
            }
        };
        rise(t) - rise(t + 1)
    }

    /// From the derivative by the decoder's inputs to those by the states of encoder (added) and decoder (set).
    fn sample_back(&self, t: usize, weight: T, model: &ModelAdjoint<T>, d: &mut Back<T>) {
        let (z, h) = (self.shape.latent, self.shape.hidden);
        let d_latent = d.latent.at_mut(t);
        let rows = d_latent.chunks_exact_mut(2 * z).zip(self.latent.at(t).chunks_exact(2 * z));
        let noise = self.noise.latent.at(t).chunks_exact(z);
        for (((d_latent, latent), noise), d_inputs) in rows.zip(noise).zip(d.decoder_inputs.chunks_exact(z + h)) {
            let (d_mean, d_log) = d_latent.split_at_mut(z);
            let (mean, log_deviation) = latent.split_at(z);
            for k in 0..z {
                let deviation = log_deviation[k].exp();
                d_mean[k] = d_inputs[k] + weight * mean[k];
                d_log[k] = d_inputs[k] * noise[k] * deviation + weight * (deviation * deviation - T::of(1.0));
            }
        }
        for (state, inputs) in d.decoder_state.chunks_exact_mut(h).zip(d.decoder_inputs.chunks_exact(z + h)) {
            state.copy_from_slice(&inputs[z..]);
        }
        model.latent.add_inputs(d.latent.at(t), &mut d.encoder_state);
    }

    /// From the derivative by the encoder's inputs to those by the states of encoder (set) and decoder (added), and by the
    /// depth (added).
    fn read_back(&self, t: usize, model: &ModelAdjoint<T>, reader: &mut Reader<T>, d: &mut Back<T>) {
        let (pixels, glimpse, h) = (self.shape.pixels(), self.shape.glimpse(), self.shape.hidden);
        let width = glimpse + 2 * h;
        for k in 0..self.batch {
            let d_inputs = &d.encoder_inputs[k * width..(k + 1) * width];
            let (d_glance, d_states) = d_inputs.split_at(glimpse);
            let (d_decoder, d_encoder) = d_states.split_at(h);
            d.encoder_state[k * h..(k + 1) * h].copy_from_slice(d_encoder);
            for (sum, &v) in d.decoder_state[k * h..(k + 1) * h].iter_mut().zip(d_decoder) {
                *sum += v;
            }
            let image = k * pixels..(k + 1) * pixels;
            let asked = &self.attention.at(t)[5 * k..5 * k + 5];
            let glance = &self.encoder.inputs.at(t)[k * width..k * width + glimpse];
            reader.back(
                (asked, &self.wanted[image.clone()], &self.ink.at(t)[image.clone()]),
                (glance, d_glance),
                &mut d.attention.at_mut(t)[5 * k..5 * k + 5],
                &mut d.depth[image],
            );
        }
        model.attention.add_inputs(d.attention.at(t), &mut d.decoder_state);
    }
}
