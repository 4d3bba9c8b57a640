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

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Point3, Vector3};
    use paint_sim::flight::FlightSample;

    use super::*;

    /// A plan of 20 s along y at 1 m/s, the valve open all the time.
    struct Line;

    impl Reference for Line {
        fn duration(&self) -> f64 {
            20.0
        }

        fn at(&self, t: f64) -> ReferenceState {
            let zero = Vector3::zeros();
            ReferenceState {
                position: Point3::new(0.0, t.clamp(0.0, 20.0), 1.0),
                velocity: Vector3::y(),
                acceleration: zero,
                heading: 0.0,
                heading_rate: 0.0,
                lever: zero,
                aim: None,
                nozzle_distance: 0.1,
                flow: 1.0,
            }
        }
    }

    fn sample(time: f64) -> FlightSample {
        let (nowhere, zero) = (Point3::origin(), Vector3::zeros());
        FlightSample {
            time,
            world_from_body: Isometry3::identity(),
            velocity: zero,
            acceleration: zero,
            attitude: [0.0; 3],
            estimated_position: nowhere,
            reference_position: nowhere,
            pan_tilt: [0.0; 2],
            desired_pan_tilt: [0.0; 2],
            nozzle: nowhere,
            axis: Vector3::x_axis(),
            aim: None,
            hit: None,
            distance: f64::INFINITY,
            wanted_distance: 0.1,
            flow: 0.0,
            held: false,
        }
    }

    fn piece(from: f64, until: f64) -> Piece<'static> {
        Piece::of(&Line, Sortie { from, until, paint: 0.0 })
    }

    #[test]
    fn a_piece_runs_up_and_out_with_the_valve_shut() {
        let middle = piece(5.0, 8.0);
        assert_eq!(middle.duration(), RUN_UP + 3.0 + RUN_OUT);
        for (time, flow) in [(0.0, 0.0), (RUN_UP - 0.01, 0.0), (RUN_UP, 1.0), (RUN_UP + 2.99, 1.0), (RUN_UP + 3.0, 0.0)]
        {
            let state = middle.at(time);
            assert_eq!(state.flow, flow, "{time}");
            assert!((state.position.y - (5.0 - RUN_UP + time)).abs() < 1e-12, "{time}");
        }
        // The first has no time to run up, the last none to run out; its last moment is painted.
        assert_eq!(piece(0.0, 8.0).at(0.0).flow, 1.0);
        let last = piece(15.0, 20.0);
        assert_eq!(last.duration(), RUN_UP + 5.0);
        assert_eq!(last.at(last.duration()).flow, 1.0);
    }

    /// Pieces that follow each other leave each sample of the plan once, by the plan's time.
    #[test]
    fn pieces_cut_to_the_whole() {
        let interval = 0.25;
        let flown = |piece: &Piece| {
            let count = (piece.duration() / interval).round() as usize;
            let samples = (0..=count).map(|k| sample(interval * k as f64)).collect();
            let log = FlightLog { samples, interval };
            piece.cut(log).samples.into_iter().map(|sample| sample.time).collect::<Vec<f64>>()
        };
        let times = [(0.0, 8.0), (8.0, 13.0), (13.0, 20.0)].map(|(from, until)| flown(&piece(from, until))).concat();
        let whole: Vec<f64> = (0..=80).map(|k| interval * f64::from(k)).collect();
        assert_eq!(times, whole);
    }
}
