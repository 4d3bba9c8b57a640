//! Where a stroke ends although the button is still pressed (ours), and how long it is.

use super::settings::SessionSettings;
use super::state::VrState;

/// Whether `next` begins another stroke than `last`, the latest state with a hit.
pub(super) fn breaks(last: &VrState, next: &VrState, settings: &SessionSettings) -> bool {
    let (Some(from), Some(to)) = (last.hit, next.hit) else { return true };
    next.colour != last.colour
        || next.time - last.time > settings.hit_gap
        || (to.point - from.point).norm() > settings.hit_jump
        || to.normal.angle(&from.normal) > settings.normal_jump
}

/// Way of the hit from one state to the next, m.
pub(super) fn painted_step(from: &VrState, to: &VrState) -> f64 {
    from.hit.zip(to.hit).map_or(0.0, |(from, to)| (to.point - from.point).norm())
}
