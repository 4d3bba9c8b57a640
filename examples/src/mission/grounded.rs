//! A robot that stays on the ground: what was painted before a later flight that cannot be flown is kept.

use super::error::MissionError;

/// Why there are no more flights. As an error it is the last word of a run that has written what it has.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("not all is flown: {why}; the results show what is painted, and {left_s:.0} s of the plans are left")]
pub struct Grounded {
    /// Time of the plans that was not flown, s.
    pub left_s: f64,
    /// What the flight said.
    pub why: String,
}

impl Grounded {
    /// After an error of a flight, with so much left of the plans.
    pub(super) fn by(error: &MissionError, left_s: f64) -> Self {
        Self { left_s, why: error.to_string() }
    }
}
