//! How far the vehicle is behind the hand (VR paper, Section VI-B).

use super::feedback::Feedback;
use super::settings::SessionSettings;
use super::task::Segment;

/// Latency in time, s: from the first state of the segment that is processed to the state that comes in at `now`.
pub fn latency_in_time(now: f64, processed: &Segment) -> f64 {
    processed.states.first().map_or(0.0, |first| now - first.time)
}

/// Rule (d): shows the vehicle while it is far behind, and hides it when it has made good half of that.
#[derive(Debug, Clone, Default)]
pub struct LagIndicator {
    shown: bool,
}

impl LagIndicator {
    /// Takes the latency in distance, m; returns what changes for the person.
    pub fn update(&mut self, lag: f64, settings: &SessionSettings) -> Option<Feedback> {
        let shown = lag > settings.show_vehicle * if self.shown { 0.5 } else { 1.0 };
        let changed = shown != self.shown;
        self.shown = shown;
        changed.then_some(if shown { Feedback::ShowVehicle { lag } } else { Feedback::HideVehicle })
    }
}
