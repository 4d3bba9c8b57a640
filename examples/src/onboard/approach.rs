//! The way from where the robot finds itself to where its plan begins.

use nalgebra::{Point3, Vector3};
use paint_planner::onboard::StraightWay;
use paint_sim::flight::{FlightLog, Reference, ReferenceState};

use crate::adapters::reference_state;
use crate::simulated_sensors::HALF_VIEW;

/// Seconds for a metre: 0.4 m/s at most.
const PACE: f64 = 5.0;
/// Time that a leg takes at least, s.
const SHORTEST: f64 = 1.0;

/// A plan that is flown from farther off: in straight legs with the least jerk to its first state, then as it is.
pub struct Approach<'a> {
    plan: &'a dyn Reference,
    legs: Vec<StraightWay>,
}

impl<'a> Approach<'a> {
    /// Before a plan, from so far straight behind its beginning, m.
    pub fn to(plan: &'a dyn Reference, stands_back: f64) -> Self {
        let first = plan.at(0.0);
        let back = behind(&first, stands_back);
        Self { plan, legs: vec![leg([back, first.position], [first.heading; 2])] }
    }

    /// The same by way of a place from which the camera sees as much as it can of a surface that faces smaller x, within two corners: at its rim
    /// the robot would see half of it, and might not find itself.
    pub fn before(plan: &'a dyn Reference, stands_back: f64, [low, high]: [Point3<f64>; 2]) -> Self {
        let first = plan.at(0.0);
        let back = behind(&first, stands_back);
        // As far off as it will be, and from everything.
        let x = back.x.min(low.x - stands_back);
        let distance = f64::midpoint(low.x, high.x) - x;
        let within = |axis: usize, half_view: f64| {
            let [low, high] = [low[axis] + half_view * distance, high[axis] - half_view * distance];
            if low < high { back[axis].clamp(low, high) } else { f64::midpoint(low, high) }
        };
        let place = Point3::new(x, within(1, HALF_VIEW[0]), within(2, HALF_VIEW[1]));
        let mut approach = Self::to(plan, stands_back);
        approach.legs.insert(0, leg([place, back], [0.0, first.heading]));
        approach
    }

    /// How long it takes until the plan begins, s.
    fn time(&self) -> f64 {
        self.legs.iter().map(|leg| leg.duration).sum()
    }

    /// The flight of the plan itself, by its own time.
    pub fn cut(&self, log: FlightLog) -> FlightLog {
        let (FlightLog { mut samples, interval }, before) = (log, self.time());
        // Half an interval, or rounding would decide about a sample.
        samples.retain(|sample| sample.time > before - 0.5 * interval);
        for sample in &mut samples {
            sample.time -= before;
        }
        FlightLog { samples, interval }
    }
}

/// So far straight behind where a plan begins, m.
fn behind(first: &ReferenceState, back: f64) -> Point3<f64> {
    first.position - Vector3::new(first.heading.cos(), first.heading.sin(), 0.0) * back
}

fn leg(ends: [Point3<f64>; 2], heading: [f64; 2]) -> StraightWay {
    // In steps of control, so that the plan begins with one.
    let duration = (1e2 * PACE * (ends[1] - ends[0]).norm()).round() / 1e2;
    StraightWay { ends, heading, duration: duration.max(SHORTEST) }
}

impl Reference for Approach<'_> {
    fn duration(&self) -> f64 {
        self.time() + self.plan.duration()
    }

    fn at(&self, t: f64) -> ReferenceState {
        let mut t = t;
        for leg in &self.legs {
            if t < leg.duration {
                return reference_state(&leg.at(t, self.plan.at(0.0).lever));
            }
            t -= leg.duration;
        }
        self.plan.at(t)
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
        let approach = Approach::to(&Line, 0.9);
        assert_eq!(approach.time(), 4.5);
        let begin = approach.at(0.0);
        let back = Line.at(0.0).position - begin.position;
        assert!((back - 0.9 * Vector3::new(0.5_f64.cos(), 0.5_f64.sin(), 0.0)).norm() < 1e-12, "{back}");
        assert_eq!(begin.velocity, Vector3::zeros());
        for k in 1..450 {
            let t = 0.01 * f64::from(k);
            let state = approach.at(t);
            assert!(state.flow == 0.0 && state.aim.is_none());
            // The derivatives are those of the position.
            let (before, after) = (approach.at(t - 1e-4), approach.at((t + 1e-4).min(4.5 - 1e-9)));
            assert!(((after.position - before.position) / 2e-4 - state.velocity).norm() < 1e-4, "t = {t}");
            assert!(((after.velocity - before.velocity) / 2e-4 - state.acceleration).norm() < 1e-3, "t = {t}");
            assert!(state.velocity.norm() < 0.4);
        }
        assert_eq!(approach.at(5.0), Line.at(0.5));
        assert!((approach.at(4.5 - 1e-6).position - Line.at(0.0).position).norm() < 1e-9);
        assert_eq!(approach.duration(), 6.5);
    }

    /// The line begins at the left lower corner of a wall of 6 m by 3 m. From 2.4 m before its middle a camera of 79 by 55 degrees sees 3.9 m by 2.5 m.
    #[test]
    fn it_begins_where_the_camera_sees_the_surface_and_is_never_nearer() {
        let corners = [Point3::new(1.9, -6.0, 2.0), Point3::new(2.5, 0.0, 5.0)];
        let approach = Approach::before(&Line, 0.9, corners);
        let begin = approach.at(0.0);
        let back = behind(&Line.at(0.0), 0.9);
        assert!((begin.position.x - back.x).abs() < 1e-12 && begin.heading == 0.0);
        let distance = 2.2 - begin.position.x;
        // Nothing beside the wall is in view.
        let [left, down] = [188.0, 120.0].map(|pixels| pixels / 229.0 * distance);
        assert!(
            (begin.position.y + left).abs() < 1e-9 && (begin.position.z - down - 2.0).abs() < 1e-9,
            "{}",
            begin.position
        );
        let (mut before, mut fastest) = (begin.position, 0.0_f64);
        let steps = (1e2 * approach.time()).round() as i32;
        for k in 0..steps {
            let state = approach.at(0.01 * f64::from(k));
            assert!((state.position - before).norm() < 0.005 && state.position.x <= 1.0 + 1e-9, "{k}");
            (before, fastest) = (state.position, fastest.max(state.velocity.norm()));
        }
        assert!(fastest < 0.4, "{fastest}");
        assert_eq!(approach.at(0.01 * f64::from(steps) + 1e-9).flow, 1e-6);
        // Of a small surface the middle.
        let small =
            Approach::before(&Line, 0.9, [Point3::new(2.0, -0.5, 2.0), Point3::new(2.2, 0.1, 2.6)]).at(0.0).position;
        assert!((small.y + 0.2).abs() < 1e-12 && (small.z - 2.3).abs() < 1e-12);
    }
}
