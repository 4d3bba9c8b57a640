//! The loss of the thesis' network, term by term.

use super::rollout::{Objective, Rollout};
use super::stop;
use crate::network::Real;

/// Sums over the batch, in nats.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct LossTerms {
    pub(crate) cross_entropy: f64,
    pub(crate) latent: f64,
    pub(crate) stop: f64,
    pub(crate) variation: f64,
}

impl LossTerms {
    pub(crate) fn total(&self, objective: &Objective) -> f64 {
        self.cross_entropy
            + objective.latent * self.latent
            + objective.stop * self.stop
            + objective.variation * self.variation
    }
}

/// The loss, term by term.
pub(crate) fn loss_terms<T: Real>(rollout: &Rollout<T>, prior: f64) -> LossTerms {
    let mut loss_terms = LossTerms::default();
    let steps = rollout.architecture.steps;
    for (&ink, &wanted) in rollout.ink.at(steps).iter().zip(&rollout.wanted) {
        let (shown, wanted) = (floored(ink).to_f64(), wanted.to_f64());
        loss_terms.cross_entropy -= wanted * shown.ln() + (1.0 - wanted) * (1.0 - shown).ln();
    }
    for t in 0..steps {
        for latent in rollout.latent.at(t).chunks_exact(2 * rollout.architecture.latent) {
            let (mean, log_deviation) = latent.split_at(rollout.architecture.latent);
            for (m, l) in mean.iter().zip(log_deviation) {
                let (m, l) = (m.to_f64(), l.to_f64());
                loss_terms.latent += 0.5 * (m * m + (2.0 * l).exp() - 2.0 * l - 1.0);
            }
        }
        for k in 0..rollout.batch {
            loss_terms.stop +=
                stop::divergence(rollout.stop_sample(t, k), rollout.logit.at(t)[k], T::of(prior)).to_f64();
            if t > 0 {
                loss_terms.variation += (rollout.volume.at(t)[k].to_f64() - rollout.volume.at(t - 1)[k].to_f64()).abs();
            }
        }
    }
    loss_terms
}

/// Ink never reaches 0 or 1 in the cross-entropy, or a bare wall would cost infinitely much.
pub(crate) const FLOOR: f64 = 1e-3;

/// `ε + (1 - 2ε) a`.
pub(crate) fn floored<T: Real>(ink: T) -> T {
    T::of(FLOOR) + T::of(1.0 - 2.0 * FLOOR) * ink
}
