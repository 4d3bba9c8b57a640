//! What the planner is asked for.

use super::state::{VrMode, VrState};

/// States of one mode that belong together.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Segment {
    /// What the person did: painting or viewing.
    pub mode: VrMode,
    /// The states, oldest first; in painting mode all of them have a hit.
    pub states: Vec<VrState>,
    /// Length of everything painted before it, m: where on the pattern it begins.
    pub start: f64,
    /// Its own length, m: of hits while painting, of nozzle positions while viewing.
    pub length: f64,
}

/// `PlanTask` of Algorithm 1.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Task {
    /// Paint along the hits, or look along the nozzle's way.
    Segment(Segment),
    /// Rule (c): go to where painting or viewing begins, with the valve shut.
    Approach(VrState),
    /// Rule (a): go to where the person is.
    Seek(VrState),
}
