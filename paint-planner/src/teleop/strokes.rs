//! What was painted while the robot does not follow: it can be taken back until it is flown.

use nalgebra::Point3;

use super::offline::segments;
use super::settings::SessionSettings;
use super::state::{VrMode, VrState};
use super::task::Segment;

/// Strokes in their order, with an idle state between them.
#[derive(Debug, Clone, Default)]
pub(super) struct Strokes {
    states: Vec<VrState>,
}

impl Strokes {
    /// A state that paints goes on with the stroke.
    pub(super) fn paint(&mut self, tick: VrState) {
        self.states.push(tick);
    }

    /// One that does not ends it.
    pub(super) fn rest(&mut self, tick: VrState) {
        if self.states.last().is_some_and(|last| last.mode != VrMode::Idle) {
            self.states.push(idle(tick));
        }
    }

    /// Takes back the last stroke, from its press to its release; empty where there is none.
    pub(super) fn undo(&mut self) -> Vec<VrState> {
        while self.states.last().is_some_and(|last| last.mode == VrMode::Idle) {
            self.states.pop();
        }
        let begin = self.states.iter().rposition(|state| state.mode == VrMode::Idle).map_or(0, |idle| idle + 1);
        self.states.split_off(begin)
    }

    /// Takes back what lies within a radius of a point, m.
    pub(super) fn erase(&mut self, point: &Point3<f64>, radius: f64) -> Vec<VrState> {
        let inside = |state: &VrState| state.hit.is_some_and(|hit| (hit.point - point).norm() <= radius);
        let mut erased = Vec::new();
        for state in &mut self.states {
            if inside(state) {
                erased.push(*state);
                // A pause where the stroke was: what is left of it are two.
                *state = idle(*state);
            }
        }
        self.states.dedup_by(|b, a| a.mode == VrMode::Idle && b.mode == VrMode::Idle);
        erased
    }

    /// Everything as segments, to be flown.
    pub(super) fn take(&mut self, settings: &SessionSettings) -> Vec<Segment> {
        segments(std::mem::take(&mut self.states), settings)
    }
}

fn idle(state: VrState) -> VrState {
    VrState { mode: VrMode::Idle, hit: None, ..state }
}
