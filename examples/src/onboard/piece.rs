//! A piece of a plan, flown by itself: with a run-up to where the paint goes on, and on for a moment after it ends.

use paint_planner::onboard::Sortie;
use paint_sim::flight::{FlightLog, Reference, ReferenceState};

/// So much of the plan before and after a piece is flown without paint, s.
const RUN_UP: f64 = 2.5;
const RUN_OUT: f64 = 0.5;

/// A piece of a plan by its own clock, which begins with the run-up.
pub struct Piece<'a> {
    plan: &'a dyn Reference,
    sortie: Sortie,
    begin: f64,
}

impl<'a> Piece<'a> {
    /// Of a plan.
    pub fn of(plan: &'a dyn Reference, sortie: Sortie) -> Self {
        Self { plan, sortie, begin: (sortie.from - RUN_UP).max(0.0) }
    }

    /// The piece alone in the log of its flight, by the time of the plan.
    pub fn cut(&self, log: FlightLog) -> FlightLog {
        let FlightLog { mut samples, interval } = log;
        let is_last = self.sortie.until >= self.plan.duration();
        // Half an interval, or rounding would decide about a sample.
        let [from, until] = [self.sortie.from, self.sortie.until].map(|time| time - 0.5 * interval);
        for sample in &mut samples {
            sample.time += self.begin;
        }
        samples.retain(|sample| sample.time > from && (is_last || sample.time < until));
        FlightLog { samples, interval }
    }
}

impl Reference for Piece<'_> {
    fn duration(&self) -> f64 {
        (self.sortie.until + RUN_OUT).min(self.plan.duration()) - self.begin
    }

    fn at(&self, t: f64) -> ReferenceState {
        let time = self.begin + t;
        let state = self.plan.at(time);
        let Sortie { from, until, .. } = self.sortie;
        let paints = from <= time && (time < until || until >= self.plan.duration());
        ReferenceState { flow: if paints { state.flow } else { 0.0 }, ..state }
    }
}
