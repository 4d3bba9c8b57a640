//! `report.json` of a design.

use std::collections::VecDeque;
use std::time::Instant;

use serde::Serialize;

/// The figures. Flat, SI units in the names.
#[derive(Debug, Default, Serialize)]
pub(super) struct DesignFigures {
    pub(super) surface: String,
    /// Changes of the design, and those that were refused.
    pub(super) changes: u64,
    pub(super) refused_changes: u64,
    /// Estimates that were told, coarse ones and those of the mission's own texels.
    pub(super) coarse_estimates: u64,
    pub(super) own_estimates: u64,
    /// From the arrival of a change to its first estimate, seconds; changes that another one overtook are not counted.
    pub(super) first_estimate_s_median: f64,
    pub(super) first_estimate_s_max: f64,
    pub(super) missions: u64,
    pub(super) refused_connections: u64,
    pub(super) connections: u64,
    pub(super) unsent_messages: u64,
    pub(super) version: &'static str,
}

/// Times from a change to its first estimate.
#[derive(Default)]
pub(super) struct AnswerTimes {
    asked: VecDeque<(u64, Instant)>,
    seconds: Vec<f64>,
}

impl AnswerTimes {
    /// A change has come.
    pub(super) fn ask(&mut self, number: u64) {
        self.asked.push_back((number, Instant::now()));
    }

    /// Its estimate is told.
    pub(super) fn answer(&mut self, number: u64) {
        while let Some((asked, when)) = self.asked.pop_front_if(|(asked, _)| *asked <= number) {
            if asked == number {
                self.seconds.push(when.elapsed().as_secs_f64());
            }
        }
    }

    /// Median and longest, s; 0 without any.
    pub(super) fn median_and_longest(&self) -> [f64; 2] {
        let mut seconds = self.seconds.clone();
        seconds.sort_by(f64::total_cmp);
        [seconds.get(seconds.len() / 2), seconds.last()].map(|s| s.copied().unwrap_or_default())
    }
}
