//! The air valve: it answers late.

use std::collections::VecDeque;

use crate::error::{Error, check_not_negative};

/// Delays of the valve.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct ValveSettings {
    /// From the command to open until paint flies, s (default 4 ms: 1 ms of the valve and 3 ms of the line).
    pub open_delay: f64,
    /// From the command to shut until it stops, s (default 4 ms).
    pub close_delay: f64,
}

impl Default for ValveSettings {
    fn default() -> Self {
        Self { open_delay: 4e-3, close_delay: 4e-3 }
    }
}

/// A valve that is told to open and shut.
#[derive(Debug, Clone)]
pub struct Valve {
    settings: ValveSettings,
    open: bool,
    commanded: bool,
    /// Changes to come: when, and to what.
    pending: VecDeque<(f64, bool)>,
    /// Commands that changed something.
    pub switched: usize,
}

impl Valve {
    /// Shut.
    ///
    /// # Errors
    /// Delays that are negative.
    pub fn new(settings: ValveSettings) -> Result<Self, Error> {
        check_not_negative("valve.open_delay", settings.open_delay)?;
        check_not_negative("valve.close_delay", settings.close_delay)?;
        Ok(Self { settings, open: false, commanded: false, pending: VecDeque::new(), switched: 0 })
    }

    /// Tells it at `time` (s) to open or to shut; times must not go back.
    pub fn command(&mut self, time: f64, open: bool) {
        if open == self.commanded {
            return;
        }
        self.commanded = open;
        self.switched += 1;
        let delay = if open { self.settings.open_delay } else { self.settings.close_delay };
        // A later command that acts sooner overtakes those before it.
        while self.pending.back().is_some_and(|(at, _)| *at >= time + delay) {
            self.pending.pop_back();
        }
        self.pending.push_back((time + delay, open));
    }

    /// Share of the time from `from` to `to` (s) during which paint flies. Must be asked in order.
    pub fn open_share(&mut self, from: f64, to: f64) -> f64 {
        let (mut at, mut flows) = (from, 0.0);
        while let Some((change, open)) = self.pending.front().copied().filter(|(change, _)| *change < to) {
            let change_in = change.max(at);
            flows += if self.open { change_in - at } else { 0.0 };
            (at, self.open) = (change_in, open);
            self.pending.pop_front();
        }
        flows += if self.open { to - at } else { 0.0 };
        (flows / (to - from)).clamp(0.0, 1.0)
    }
}
