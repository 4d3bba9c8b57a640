//! Whether a registration ended in a wrong minimum: at the right pose map and frame agree, in depth and in intensity.
//!
//! A camera that turns by some degrees from frame to frame leaves the basin of the cost. The nearest minimum is then a wrong one; before a
//! wall even its depths agree, but its intensities do not. All bounds are ours, from runs with known poses.

use crate::tracking::outcome::TrackingOutcome;
use crate::tracking::settings::TrackingSettings;
use crate::tracking::tracker::{LEAST_LIKENESS, Tracker};

/// Agreement and likeness that a pose may have less than those before it.
const DROP: [f64; 2] = [0.06, 0.1];
/// Share of a frame in what is usual.
const LEARNED: f64 = 0.2;
/// Intensities that correlate by less are of another place, whatever the depth says.
const UNLIKE: f64 = 0.5;

/// How much map and frame agree in a recording.
#[derive(Debug, Default)]
pub(crate) struct UsualAgreement {
    /// Agreement and likeness of the frames lately; `None` before the first one.
    pub(crate) usual: Option<[f64; 2]>,
}

impl UsualAgreement {
    /// Learns from a pose that is believed.
    pub(crate) fn learn(&mut self, outcome: &TrackingOutcome) {
        let own = [outcome.agreement, outcome.likeness.unwrap_or_default()];
        let mean = |usual: [f64; 2]| [0, 1].map(|k| usual[k] + LEARNED * (own[k] - usual[k]));
        self.usual = Some(self.usual.map_or(own, mean));
    }

    /// Whether other poses should be tried: map and frame agree less than they must, or clearly less than they did lately.
    pub(crate) fn is_doubtful(&self, outcome: &TrackingOutcome, tracker: &Tracker) -> bool {
        let below = self.usual.is_some_and(|[agreement, likeness]| {
            outcome.agreement < agreement - DROP[0] || outcome.likeness.is_some_and(|own| own < likeness - DROP[1])
        });
        !outcome.is_tracked() || !tracker.convinces(outcome) || below
    }
}

/// Order of outcomes, the better later: tracked, then by how much map and frame agree, and how much of both.
pub(crate) fn rank(outcome: &TrackingOutcome) -> (bool, f64) {
    let seen = outcome.agreement * outcome.coverage.min(outcome.overlap);
    (outcome.is_tracked(), outcome.agreement + seen + outcome.likeness.unwrap_or_default())
}

/// Whether an outcome must be wrong, when no other pose was found to be better.
pub(crate) fn is_contradicted(outcome: &TrackingOutcome, settings: &TrackingSettings) -> bool {
    let disagrees = outcome.agreement < settings.relocalise_agreement;
    outcome.likeness.is_some_and(|likeness| likeness < UNLIKE || (likeness < LEAST_LIKENESS && disagrees))
}
