//! States as they come onto the clock of the session, 90 times a second.

use nalgebra::UnitVector3;

use super::breaks::breaks;
use super::settings::SessionSettings;
use super::state::{PaintHit, RATE, VrMode, VrState};

/// Longest time between two states over which the session goes on, s: nobody knows what the hand did in a longer one.
const LONGEST_GAP: f64 = 1.0;

/// What became of the states.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ResampleCounts {
    /// States that came in.
    pub states: u64,
    /// Those that were not later than the one before, and were left out.
    pub not_later: u64,
    /// Ticks without a state because none came for a second.
    pub missing_ticks: u64,
    /// Ticks that came out.
    pub ticks: u64,
}

/// Puts states onto ticks of 1/90 s after the first one; between two states of one stroke it interpolates.
#[derive(Debug, Clone)]
pub struct Resampler {
    settings: SessionSettings,
    origin: f64,
    last: Option<VrState>,
    next_tick: u64,
    counts: ResampleCounts,
}

impl Resampler {
    /// A clock that begins with the first state.
    pub fn new(settings: SessionSettings) -> Self {
        Self { settings, origin: 0.0, last: None, next_tick: 0, counts: ResampleCounts::default() }
    }

    /// Takes a state and appends the ticks up to it: their `sequence` is the tick's number, their `time` counts from the first state.
    pub fn push(&mut self, state: VrState, ticks: &mut Vec<VrState>) {
        self.counts.states += 1;
        let Some(last) = self.last else {
            self.origin = state.time;
            self.last = Some(state);
            self.emit(state, ticks);
            return;
        };
        if state.time <= last.time {
            self.counts.not_later += 1;
            return;
        }
        if state.time - last.time > LONGEST_GAP {
            let resumed = ((state.time - self.origin) * RATE).ceil() as u64;
            self.counts.missing_ticks += resumed.saturating_sub(self.next_tick);
            self.next_tick = self.next_tick.max(resumed);
            self.last = Some(state);
            return;
        }
        while self.tick_time() <= state.time {
            let share = ((self.tick_time() - last.time) / (state.time - last.time)).clamp(0.0, 1.0);
            self.emit(self.between(&last, &state, share), ticks);
        }
        self.last = Some(state);
    }

    /// What became of the states so far.
    pub fn counts(&self) -> ResampleCounts {
        self.counts
    }

    fn tick_time(&self) -> f64 {
        self.origin + self.next_tick as f64 / RATE
    }

    fn emit(&mut self, state: VrState, ticks: &mut Vec<VrState>) {
        ticks.push(VrState { sequence: self.next_tick, time: self.next_tick as f64 / RATE, ..state });
        self.next_tick += 1;
        self.counts.ticks += 1;
    }

    /// The state at a share of the way; what cannot be interpolated is that of the earlier one.
    fn between(&self, from: &VrState, to: &VrState, share: f64) -> VrState {
        if share >= 1.0 {
            return *to;
        }
        let turn = |a: f64, b: f64| {
            let difference = (b - a).sin().atan2((b - a).cos());
            a + share * difference
        };
        let mut state = *from;
        state.cradle.position += share * (to.cradle.position - from.cradle.position);
        state.cradle.heading = turn(from.cradle.heading, to.cradle.heading);
        if from.mode != to.mode {
            return state;
        }
        state.nozzle.translation.vector += share * (to.nozzle.translation.vector - from.nozzle.translation.vector);
        if let Some(rotation) = from.nozzle.rotation.try_slerp(&to.nozzle.rotation, share, 1e-9) {
            state.nozzle.rotation = rotation;
        }
        let one_stroke =
            from.mode == VrMode::Painting && !breaks(from, &VrState { time: from.time, ..*to }, &self.settings);
        if let (true, Some(a), Some(b)) = (one_stroke, from.hit, to.hit) {
            let mixed = a.normal.lerp(&b.normal, share);
            state.hit = UnitVector3::try_new(mixed, 1e-9)
                .map(|normal| PaintHit { point: a.point + share * (b.point - a.point), normal });
        }
        state
    }
}
