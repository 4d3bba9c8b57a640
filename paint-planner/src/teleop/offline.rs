//! A session that is planned when it is over: segments from press to release (VR paper, Section III-B).

use super::breaks::{breaks, painted_step};
use super::settings::SessionSettings;
use super::state::{VrMode, VrState};
use super::task::Segment;

/// Cuts states, oldest first, into segments from press to release, and further where a stroke breaks: at jumps of the hit or the
/// normal, at another colour, where the ray met nothing for longer than `settings.hit_gap`. Painting states without a hit are left out.
pub fn segments(states: impl IntoIterator<Item = VrState>, settings: &SessionSettings) -> Vec<Segment> {
    let mut segments: Vec<Segment> = Vec::new();
    let mut pressed = VrMode::Idle;
    let mut painted = 0.0;
    for state in states {
        let mode = state.mode;
        let released = mode != pressed;
        pressed = mode;
        if mode == VrMode::Idle || (mode == VrMode::Painting && state.hit.is_none()) {
            continue;
        }
        let last = segments.last_mut().filter(|_| !released);
        let open = last.filter(|segment| {
            mode == VrMode::Viewing || segment.states.last().is_some_and(|last| !breaks(last, &state, settings))
        });
        if let Some(segment) = open {
            let step = segment.states.last().map_or(0.0, |last| match mode {
                VrMode::Painting => painted_step(last, &state),
                _ => (state.nozzle_position() - last.nozzle_position()).norm(),
            });
            segment.length += step;
            painted += if mode == VrMode::Painting { step } else { 0.0 };
            segment.states.push(state);
        } else {
            segments.push(Segment { mode, states: vec![state], start: painted, length: 0.0 });
        }
    }
    segments
}
