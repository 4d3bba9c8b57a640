//! The air valve: it answers late, and not at once.

use std::collections::VecDeque;

use crate::error::{Error, check_not_negative, check_positive};

/// Delays of the valve, and how long it takes to open and to shut.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct ValveSettings {
    /// From the command to open until paint flies, s (default 4 ms: 1 ms of the valve and 3 ms of the line).
    pub open_delay: f64,
    /// From the command to shut until the flow begins to fall, s (default 4 ms).
    pub close_delay: f64,
    /// From the first paint to all of the flow, in proportion to the time, s (default 0).
    pub rise: f64,
    /// From all of the flow to none, s (default 0).
    pub fall: f64,
}

impl Default for ValveSettings {
    fn default() -> Self {
        Self { open_delay: 4e-3, close_delay: 4e-3, rise: 0.0, fall: 0.0 }
    }
}

impl ValveSettings {
    /// What flows of what is commanded: of both the mean over each `interval` (s), m³/s. Zero is shut; while the valve moves, it passes its
    /// openness of the flow that was commanded last, as of `open_delay` ago.
    ///
    /// The list is longer than the commands by what flows after them. A command of the flow `q` for `T` seconds passes, if it opens wholly,
    ///
    /// ```text
    /// V = q (T + close_delay - open_delay + (fall - rise) / 2)
    /// ```
    ///
    /// # Errors
    /// Settings or flows that are negative or not finite, no interval.
    pub fn through(&self, commanded: &[f64], interval: f64) -> Result<Vec<f64>, Error> {
        check_positive("interval", interval)?;
        commanded.iter().try_for_each(|&flow| check_not_negative("commanded flow", flow))?;
        let mut valve = Valve::new(*self)?;
        if [self.open_delay, self.close_delay, self.rise, self.fall] == [0.0; 4] {
            // Without rounding.
            return Ok(commanded.to_vec());
        }
        let after = ((self.close_delay.max(self.open_delay) + self.fall) / interval).ceil() as usize + 1;
        // Whole intervals by which new flows come late, and the rest.
        let late = (self.open_delay / interval).floor();
        let rest = self.open_delay - late * interval;
        // The flow as of an interval: the last one that was not zero, before the first one that.
        let mut level = commanded.iter().copied().find(|&flow| flow > 0.0).unwrap_or_default();
        let flows = |k: usize| {
            let start = k as f64 * interval;
            let flow = commanded.get(k).copied().unwrap_or_default();
            valve.command(start, flow > 0.0);
            let before = level * valve.passed(start, start + rest);
            let due = k.checked_sub(late as usize).and_then(|due| commanded.get(due)).copied().unwrap_or_default();
            level = if due > 0.0 { due } else { level };
            (before + level * valve.passed(start + rest, start + interval)) / interval
        };
        Ok((0..commanded.len() + after).map(flows).collect())
    }
}

/// A valve that is told to open and shut.
#[derive(Debug, Clone)]
pub struct Valve {
    settings: ValveSettings,
    /// Where it is going.
    open: bool,
    /// Where it is: share of the flow.
    openness: f64,
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
    /// Times that are negative.
    pub fn new(settings: ValveSettings) -> Result<Self, Error> {
        check_not_negative("valve.open_delay", settings.open_delay)?;
        check_not_negative("valve.close_delay", settings.close_delay)?;
        check_not_negative("valve.rise", settings.rise)?;
        check_not_negative("valve.fall", settings.fall)?;
        Ok(Self { settings, open: false, openness: 0.0, commanded: false, pending: VecDeque::new(), switched: 0 })
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

    /// Share of the time from `from` to `to` (s) during which paint flies, weighted by the share of the flow. Must be asked in order.
    pub fn open_share(&mut self, from: f64, to: f64) -> f64 {
        (self.passed(from, to) / (to - from)).clamp(0.0, 1.0)
    }

    /// Integral of the share of the flow over that time, s.
    fn passed(&mut self, from: f64, to: f64) -> f64 {
        let (mut at, mut flows) = (from, 0.0);
        while let Some((change, open)) = self.pending.front().copied().filter(|(change, _)| *change < to) {
            let change_in = change.max(at);
            flows += self.moved(change_in - at);
            (at, self.open) = (change_in, open);
            self.pending.pop_front();
        }
        flows + self.moved(to - at)
    }

    /// Integral of the share of the flow while it goes where it goes for a time: a ramp, then constant.
    fn moved(&mut self, time: f64) -> f64 {
        let (target, whole) = if self.open { (1.0, self.settings.rise) } else { (0.0, self.settings.fall) };
        let gap: f64 = target - self.openness;
        let ramp = (gap.abs() * whole).min(time);
        let reached = if ramp < gap.abs() * whole { self.openness + ramp / whole * gap.signum() } else { target };
        let mean = 0.5 * (self.openness + reached);
        self.openness = reached;
        mean * ramp + target * (time - ramp)
    }
}
