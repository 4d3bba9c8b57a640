//! The way from where the robot finds itself to where its plan begins.

use nalgebra::Vector3;
use paint_planner::onboard::StraightWay;
use paint_sim::flight::{FlightLog, Reference, ReferenceState};

use crate::adapters::reference_state;

/// The robot stands back by so much, m: about as far as it was from the surface when it scanned it, so that the keyframes show what it sees.
const BACK: f64 = 0.9;
/// Duration of the approach, s: 0.4 m/s at most.
const DURATION: f64 = 4.5;

/// A plan that is flown from farther off: with the least jerk to its first state, then as it is.
pub struct Approach<'a> {
    plan: &'a dyn Reference,
}

impl<'a> Approach<'a> {
    /// Before a plan.
    pub fn to(plan: &'a dyn Reference) -> Self {
        Self { plan }
    }

    /// The flight of the plan itself, by its own time.
    pub fn cut(log: FlightLog) -> FlightLog {
        let FlightLog { mut samples, interval } = log;
        // Half an interval, or rounding would decide about a sample.
        samples.retain(|sample| sample.time > DURATION - 0.5 * interval);
        for sample in &mut samples {
            sample.time -= DURATION;
        }
        FlightLog { samples, interval }
    }
}

impl Reference for Approach<'_> {
    fn duration(&self) -> f64 {
        DURATION + self.plan.duration()
    }

    fn at(&self, t: f64) -> ReferenceState {
        if t >= DURATION {
            return self.plan.at(t - DURATION);
        }
        let first = self.plan.at(0.0);
        let ahead = Vector3::new(first.heading.cos(), first.heading.sin(), 0.0);
        let back = first.position - ahead * BACK;
        let way = StraightWay { ends: [back, first.position], heading: [first.heading; 2], duration: DURATION };
        reference_state(&way.at(t, first.lever))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;

    /// Flies along y at constant speed, painting.
    struct Line;

    impl Reference for Line {
        fn duration(&self) -> f64 {
            2.0
        }

        fn at(&self, t: f64) -> ReferenceState {
            let y = 0.3 * t.clamp(0.0, 2.0);
            ReferenceState {
                position: Point3::new(1.0, y, 2.0),
                velocity: Vector3::zeros(),
                acceleration: Vector3::zeros(),
                heading: 0.5,
                heading_rate: 0.0,
                lever: Vector3::zeros(),
                aim: Some(Point3::new(3.0, y, 2.0)),
                nozzle_distance: 0.1,
                flow: 1e-6,
            }
        }
    }

    #[test]
    fn it_comes_straight_from_behind_without_paint_and_then_follows_the_plan() {
        let approach = Approach::to(&Line);
        let begin = approach.at(0.0);
        let back = Line.at(0.0).position - begin.position;
        assert!((back - BACK * Vector3::new(0.5_f64.cos(), 0.5_f64.sin(), 0.0)).norm() < 1e-12, "{back}");
        assert_eq!(begin.velocity, Vector3::zeros());
        for k in 1..450 {
            let t = 0.01 * f64::from(k);
            let state = approach.at(t);
            assert!(state.flow == 0.0 && state.aim.is_none());
            // The derivatives are those of the position.
            let (before, after) = (approach.at(t - 1e-4), approach.at((t + 1e-4).min(DURATION - 1e-9)));
            assert!(((after.position - before.position) / 2e-4 - state.velocity).norm() < 1e-4, "t = {t}");
            assert!(((after.velocity - before.velocity) / 2e-4 - state.acceleration).norm() < 1e-3, "t = {t}");
            assert!(state.velocity.norm() < 0.4);
        }
        assert_eq!(approach.at(DURATION + 0.5), Line.at(0.5));
        assert!((approach.at(DURATION - 1e-6).position - Line.at(0.0).position).norm() < 1e-9);
        assert_eq!(approach.duration(), DURATION + 2.0);
    }
}
