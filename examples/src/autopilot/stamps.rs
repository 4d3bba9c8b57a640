//! Whether the stamps of a sender run with our clock.

/// A stamp may come this much earlier or later than the ones before let expect, s: latency and rounding.
const TOLERANCE: f64 = 0.1;
/// A new offset counts when it has held for this long, s.
const CONFIRMATION: f64 = 1.0;
/// A clock that starts again has a stamp below this, s, and below half of what was expected.
const JUST_STARTED: f64 = 30.0;

/// What a stamp tells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Verdict {
    /// It is where it is expected.
    Steady,
    /// The sender's clock has jumped and does not yet run steadily again.
    Jumped,
    /// The sender has been started anew.
    Restarted,
}

/// Follows the offset between our clock and that of a sender.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct StampGuard {
    /// Ours less theirs, s.
    offset: Option<f64>,
    /// An offset that was seen since a jump, and since when.
    candidate: Option<(f64, f64)>,
}

impl StampGuard {
    /// Judges a stamp that arrives at `now`, both in seconds.
    pub(super) fn judge(&mut self, now: f64, stamp: f64) -> Verdict {
        let found = now - stamp;
        let Some(offset) = self.offset else {
            self.offset = Some(found);
            return Verdict::Steady;
        };
        if (found - offset).abs() <= TOLERANCE {
            self.candidate = None;
            // Clocks drift: the offset follows slowly.
            self.offset = Some(offset + 0.01 * (found - offset));
            return Verdict::Steady;
        }
        if stamp < JUST_STARTED && stamp < 0.5 * (now - offset) {
            *self = Self { offset: Some(found), candidate: None };
            return Verdict::Restarted;
        }
        match self.candidate {
            Some((candidate, since)) if (found - candidate).abs() <= TOLERANCE => {
                if now - since >= CONFIRMATION {
                    *self = Self { offset: Some(found), candidate: None };
                    return Verdict::Steady;
                }
            }
            _ => self.candidate = Some((found, now)),
        }
        Verdict::Jumped
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn jumps_are_told_until_the_clock_runs_steadily_again() {
        let mut guard = StampGuard::default();
        let mut at = |now: f64, stamp: f64| guard.judge(now, stamp);
        for k in 0..1000 {
            // A clock that loses a millisecond in a second, with 20 ms of jitter.
            let now = 0.01 * f64::from(k);
            assert_eq!(at(now, 50.0 + 0.999 * now + 0.02 * f64::from(k % 2)), Verdict::Steady);
        }
        for k in 1000..1099 {
            assert_eq!(at(0.01 * f64::from(k), 53.0 + 0.01 * f64::from(k)), Verdict::Jumped, "{k}");
        }
        assert_eq!(at(11.0, 64.0), Verdict::Steady);
        assert_eq!(at(11.01, 3.0), Verdict::Restarted);
        assert_eq!(at(11.02, 3.01), Verdict::Steady);
        // Stamps that never agree with one another never count.
        for k in 0..1000 {
            let now = 12.0 + 0.01 * f64::from(k);
            assert_eq!(at(now, 1e3 + 7.0 * f64::from(k)), Verdict::Jumped);
        }
    }
}
