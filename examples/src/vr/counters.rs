//! What was counted.

use serde::Serialize;

/// Counts of a session.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub(super) struct SessionCounts {
    /// Events that are part of the session.
    pub events: u64,
    /// Events that came twice and were left out.
    pub repeated: u64,
    /// Times that an event came too early and was asked for again.
    pub gaps: u64,
    /// Events that were refused for what they say.
    pub refused: u64,
    /// Plans asked for, those for painting among them, and those that were refused.
    pub plans: u64,
    /// Plans for painting.
    pub paint_tasks: u64,
    /// Those that took over in flight, without a halt.
    pub continued: u64,
    /// Plans that the planner refused.
    pub refused_tasks: u64,
    /// Plans for painting that it refused.
    pub refused_paint: u64,
    /// Targets of the plans for painting.
    pub targets: u64,
    /// Those that are served.
    pub targets_served: u64,
    /// States whose paint was taken back.
    pub taken_back: u64,
}

/// What the network and the processor had to do.
#[derive(Debug, Clone, Default)]
pub(super) struct Traffic {
    pub(super) malformed: u64,
    pub(super) too_many: u64,
    pub(super) refused: u64,
    pub(super) connections: u64,
    /// Messages that a slow page did not take.
    pub(super) unsent: u64,
    worked: f64,
    events: u64,
}

impl Traffic {
    /// Adds processor time (s) that went into a number of events.
    pub(super) fn work(&mut self, seconds: f64, events: usize) {
        self.worked += seconds;
        self.events += events as u64;
    }

    /// Processor time per event, s.
    pub(super) fn work_per_event(&self) -> f64 {
        self.worked / self.events.max(1) as f64
    }
}
