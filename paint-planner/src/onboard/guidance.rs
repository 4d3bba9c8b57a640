//! Where the robot shall be: the plan, and the ways to it and back.

use nalgebra::{Point3, Vector3};

use super::straight_way::StraightWay;
use crate::control::ControlReference;

/// Mean speed of a way, m/s.
const SPEED: f64 = 0.5;
/// Mean turn rate on a way, rad/s.
const TURN_RATE: f64 = 0.5;

/// A planned flight, as far as the vehicle's motion goes.
pub trait FlightPlan {
    /// How long it lasts, s.
    fn duration(&self) -> f64;

    /// The wanted motion at `t` seconds; asked for a little before zero and after the end as well, where it should stand still.
    fn at(&self, t: f64) -> ControlReference;
}

/// What is followed now.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Guidance {
    /// A straight way at rest at both ends, with the least jerk.
    Way {
        /// The way.
        way: StraightWay,
        /// When it begins, s.
        start: f64,
    },
    /// The plan, `offset` seconds later than it says.
    Plan {
        /// Time now less time of the plan, s.
        offset: f64,
    },
}

impl Guidance {
    /// A way at the usual speed.
    pub fn way(from: Point3<f64>, from_heading: f64, to: Point3<f64>, to_heading: f64, start: f64) -> Self {
        let turn = to_heading - from_heading;
        let turn = turn.sin().atan2(turn.cos());
        let duration = ((to - from).norm() / SPEED).max(turn.abs() / TURN_RATE).max(1.0);
        Self::Way {
            way: StraightWay { ends: [from, to], heading: [from_heading, from_heading + turn], duration },
            start,
        }
    }

    /// To stay.
    pub fn stay(at: Point3<f64>, heading: f64, now: f64) -> Self {
        Self::Way { way: StraightWay { ends: [at; 2], heading: [heading; 2], duration: 1.0 }, start: now }
    }

    /// Whether a way has been at its end for `rest` seconds.
    pub fn arrived(&self, now: f64, rest: f64) -> bool {
        matches!(self, Self::Way { way, start } if now >= start + way.duration + rest)
    }

    /// The state at a time. `lever` of a way, see [`ControlReference::lever`].
    pub fn at(&self, now: f64, plan: &dyn FlightPlan, lever: Vector3<f64>) -> ControlReference {
        match *self {
            Self::Plan { offset } => plan.at(now - offset),
            Self::Way { way, start } => way.at(now - start, lever),
        }
    }
}

/// A guidance with the plan that it leads along, for controllers, which look ahead and back in it.
#[derive(Debug, Clone, Copy)]
pub struct Guided<P> {
    /// What is followed.
    pub guidance: Guidance,
    /// The plan.
    pub plan: P,
    /// Of ways, see [`ControlReference::lever`].
    pub lever: Vector3<f64>,
}

impl<P: FlightPlan> Guided<P> {
    /// The wanted motion at a time.
    pub fn at(&self, now: f64) -> ControlReference {
        self.guidance.at(now, &self.plan, self.lever)
    }

    /// Time of the plan, where that is followed.
    pub fn plan_time(&self, now: f64) -> Option<f64> {
        match self.guidance {
            Guidance::Plan { offset } => Some(now - offset),
            Guidance::Way { .. } => None,
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// A plan of 8 s along y at a height of 2 m.
    #[derive(Clone, Copy)]
    pub(in crate::onboard) struct Line;

    impl FlightPlan for Line {
        fn duration(&self) -> f64 {
            8.0
        }

        fn at(&self, t: f64) -> ControlReference {
            let place = Point3::new(3.0, 0.2 * t.clamp(0.0, 8.0), 2.0);
            let rest = Guidance::stay(place, 0.0, 0.0).at(0.0, self, Vector3::zeros());
            let velocity = if (0.0..=8.0).contains(&t) { Vector3::y() * 0.2 } else { Vector3::zeros() };
            ControlReference { velocity, ..rest }
        }
    }

    #[test]
    fn a_way_is_smooth_from_rest_to_rest() {
        let [from, to] = [Point3::new(1.0, 0.0, 0.0), Point3::new(1.0, 2.0, 0.0)];
        let way = Guidance::way(from, 3.0, to, -3.0, 10.0);
        let at = |t: f64| way.at(t, &Line, Vector3::zeros());
        assert_eq!((at(10.0).position, at(14.0).position), (from, to));
        assert!((at(12.0).position - nalgebra::center(&from, &to)).norm() < 1e-12);
        // The short way round.
        assert!((at(14.0).heading - (std::f64::consts::TAU - 3.0)).abs() < 1e-12);
        for t in [10.5, 11.7, 13.0] {
            let h = 1e-4;
            let difference = (at(t + h).position - at(t - h).position) / (2.0 * h);
            assert!((difference - at(t).velocity).norm() < 1e-6);
            let difference = (at(t + h).velocity - at(t - h).velocity) / (2.0 * h);
            assert!((difference - at(t).acceleration).norm() < 1e-6);
            assert!(((at(t + h).heading - at(t - h).heading) / (2.0 * h) - at(t).heading_rate).abs() < 1e-6);
        }
        assert!(at(10.0).acceleration.norm() + at(14.0).velocity.norm() < 1e-12);
        assert!(
            way.arrived(15.0, 1.0) && !way.arrived(14.9, 1.0) && !Guidance::Plan { offset: 0.0 }.arrived(99.0, 0.0)
        );
    }
}
