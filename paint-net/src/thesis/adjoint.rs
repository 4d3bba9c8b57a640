//! The backward pass through algorithm 3, by hand: every function here is the adjoint of one in `rollout.rs`, in reverse order.

use super::activations::Activations;
use super::architecture::Architecture;
use super::dense::DenseAdjoint;
use super::loss::{FLOOR, floored};
use super::nonlinearities::sigmoid;
use super::read_attention::ReadAttention;
use super::rollout::{Objective, Rollout};
use super::spray::{SprayParameters, SprayStamp};
use super::stop;
use crate::network::Real;

/// The layers, ready for the backward pass.
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
    pub(crate) fn new(architecture: &Architecture, parameters: &[T]) -> Self {
        let layers = architecture.layers();
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
struct RolloutGradient<T> {
    depth: Vec<T>,
    encoder_memory: Vec<T>,
    encoder_state: Vec<T>,
    decoder_memory: Vec<T>,
    decoder_state: Vec<T>,
    encoder_inputs: Vec<T>,
    decoder_inputs: Vec<T>,
    attention: Activations<T>,
    latent: Activations<T>,
    paint: Activations<T>,
    spray: Activations<T>,
    logit: Activations<T>,
}

impl<T: Real> RolloutGradient<T> {
    fn new(architecture: &Architecture, batch: usize) -> Self {
        let state = || vec![T::default(); batch * architecture.hidden];
        let rows = |width| Activations::new(architecture.steps, batch, width);
        Self {
            depth: vec![T::default(); batch * architecture.pixels()],
            encoder_memory: state(),
            encoder_state: state(),
            decoder_memory: state(),
            decoder_state: state(),
            encoder_inputs: vec![T::default(); batch * (architecture.glimpse() + 2 * architecture.hidden)],
            decoder_inputs: vec![T::default(); batch * (architecture.latent + architecture.hidden)],
            attention: rows(5),
            latent: rows(2 * architecture.latent),
            paint: rows(architecture.paint),
            spray: rows(4),
            logit: rows(1),
        }
    }
}

/// Adds the derivatives of the loss, summed over the batch, to `gradient`. What the recurrent layers remember of their
/// gates is overwritten.
pub(crate) fn backward<T: Real>(
    rollout: &mut Rollout<T>,
    model: &ModelAdjoint<T>,
    objective: &Objective,
    gradient: &mut [T],
) {
    let (mut reader, mut stamp) = (ReadAttention::new(&rollout.architecture), SprayStamp::new(&rollout.architecture));
    let mut d = RolloutGradient::new(&rollout.architecture, rollout.batch);
    let steps = rollout.architecture.steps;
    cross_entropy_backward(rollout, &mut d.depth);
    for t in (0..steps).rev() {
        paint_backward(rollout, t, model, objective, &mut stamp, &mut d);
        rollout.decoder.backward(t, &model.decoder, &mut d.decoder_memory, &d.decoder_state, &mut d.decoder_inputs);
        sample_backward(rollout, t, T::of(objective.latent), model, &mut d);
        rollout.encoder.backward(t, &model.encoder, &mut d.encoder_memory, &d.encoder_state, &mut d.encoder_inputs);
        read_backward(rollout, t, model, &mut reader, &mut d);
    }
    let (encoder, decoder) = (&rollout.encoder.state, &rollout.decoder.state);
    model.attention.add_weights(decoder.steps(0..steps), d.attention.steps(0..steps), gradient);
    rollout.encoder.add_weights(&model.encoder, steps, gradient);
    model.latent.add_weights(encoder.steps(1..steps + 1), d.latent.steps(0..steps), gradient);
    rollout.decoder.add_weights(&model.decoder, steps, gradient);
    model.paint.add_weights(decoder.steps(1..steps + 1), d.paint.steps(0..steps), gradient);
    model.spray.add_weights(rollout.paint.steps(0..steps), d.spray.steps(0..steps), gradient);
    model.stop.add_weights(decoder.steps(1..steps + 1), d.logit.steps(0..steps), gradient);
}

fn cross_entropy_backward<T: Real>(rollout: &Rollout<T>, depth: &mut [T]) {
    let (one, scale) = (T::of(1.0), T::of(1.0 - 2.0 * FLOOR));
    for ((d, &ink), &wanted) in depth.iter_mut().zip(rollout.ink.at(rollout.architecture.steps)).zip(&rollout.wanted) {
        let shown = floored(ink);
        *d = scale * (one - ink * ink) * (shown - wanted) / (shown * (one - shown));
    }
}

/// Adds to the derivative by the decoder's state.
fn paint_backward<T: Real>(
    rollout: &Rollout<T>,
    t: usize,
    model: &ModelAdjoint<T>,
    objective: &Objective,
    stamp: &mut SprayStamp<T>,
    d: &mut RolloutGradient<T>,
) {
    let (architecture, one) = (rollout.architecture, T::of(1.0));
    let (pixels, prior) = (architecture.pixels(), T::of(objective.prior));
    for k in 0..rollout.batch {
        let stop_sample = rollout.stop_sample(t, k);
        let mut d_logit = T::of(objective.stop) * stop::divergence_slope(stop_sample, prior);
        if rollout.paints(t, k) {
            let raw = &rollout.spray.at(t)[4 * k..4 * k + 4];
            let spray = SprayParameters::new(&architecture, raw);
            let sprayed = rollout.volume.at(t)[k];
            let [x, y, sigma, mut volume] = stamp.backward(&spray, sprayed, &d.depth[k * pixels..(k + 1) * pixels]);
            volume += T::of(objective.variation) * variation_slope(rollout, t, k);
            if objective.gated {
                let open = sigmoid(stop_sample);
                d_logit += volume * spray.volume * open * (one - open);
                volume = volume * open;
            }
            SprayParameters::backward(
                &architecture,
                raw,
                [x, y, sigma, volume],
                &mut d.spray.at_mut(t)[4 * k..4 * k + 4],
            );
        }
        d.logit.at_mut(t)[k] = d_logit;
    }
    let hidden = d.paint.at_mut(t);
    model.spray.add_inputs(d.spray.at(t), hidden);
    for (d, &x) in hidden.iter_mut().zip(rollout.paint.at(t)) {
        if x <= T::default() {
            *d = T::default();
        }
    }
    model.paint.add_inputs(hidden, &mut d.decoder_state);
    model.stop.add_inputs(d.logit.at(t), &mut d.decoder_state);
}

/// Of `Σ_t |v_t - v_{t-1}|` by `v_t`.
fn variation_slope<T: Real>(rollout: &Rollout<T>, t: usize, k: usize) -> T {
    let volume = |t: usize| rollout.volume.at(t)[k];
    let rise = |t: usize| {
        if t == 0 || t == rollout.architecture.steps || volume(t) == volume(t - 1) {
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
fn sample_backward<T: Real>(
    rollout: &Rollout<T>,
    t: usize,
    weight: T,
    model: &ModelAdjoint<T>,
    d: &mut RolloutGradient<T>,
) {
    let (z, h) = (rollout.architecture.latent, rollout.architecture.hidden);
    let d_latent = d.latent.at_mut(t);
    let rows = d_latent.chunks_exact_mut(2 * z).zip(rollout.latent.at(t).chunks_exact(2 * z));
    let noise = rollout.noise.latent.at(t).chunks_exact(z);
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
fn read_backward<T: Real>(
    rollout: &Rollout<T>,
    t: usize,
    model: &ModelAdjoint<T>,
    reader: &mut ReadAttention<T>,
    d: &mut RolloutGradient<T>,
) {
    let (pixels, glimpse, h) =
        (rollout.architecture.pixels(), rollout.architecture.glimpse(), rollout.architecture.hidden);
    let width = glimpse + 2 * h;
    for k in 0..rollout.batch {
        let d_inputs = &d.encoder_inputs[k * width..(k + 1) * width];
        let (d_glimpse, d_states) = d_inputs.split_at(glimpse);
        let (d_decoder, d_encoder) = d_states.split_at(h);
        d.encoder_state[k * h..(k + 1) * h].copy_from_slice(d_encoder);
        for (sum, &v) in d.decoder_state[k * h..(k + 1) * h].iter_mut().zip(d_decoder) {
            *sum += v;
        }
        let image = k * pixels..(k + 1) * pixels;
        let raw = &rollout.attention.at(t)[5 * k..5 * k + 5];
        let glimpse = &rollout.encoder.inputs.at(t)[k * width..k * width + glimpse];
        reader.backward(
            (raw, &rollout.wanted[image.clone()], &rollout.ink.at(t)[image.clone()]),
            (glimpse, d_glimpse),
            &mut d.attention.at_mut(t)[5 * k..5 * k + 5],
            &mut d.depth[image],
        );
    }
    model.attention.add_inputs(d.attention.at(t), &mut d.decoder_state);
}
