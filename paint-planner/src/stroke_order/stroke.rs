//! Strokes as their order sees them.

use crate::target::Target;

/// Where a stroke begins and ends, in the direction in which it was drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StrokeEnds {
    /// Its first target.
    pub first: Target,
    /// Its last target.
    pub last: Target,
}

/// A stroke in the order of the flight.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct OrderedStroke {
    /// Index into the strokes that were given.
    pub index: usize,
    /// Flown from its last target to its first.
    pub reversed: bool,
}
