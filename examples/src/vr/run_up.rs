//! A simulated flight that begins in motion: the simulator starts at rest, so the vehicle is brought to that motion first.

use nalgebra::Vector3;
use paint_sim::flight::FlightLog;
use paint_sim::flight::{Reference, ReferenceState};

/// Time in which the vehicle comes to the motion that a continued plan begins with, s: slow enough for its controller to be on the
/// reference when the plan begins.
pub(super) const RUN_UP: f64 = 1.5;

/// A plan with a way from rest to its first state before it, with the gun shut.
pub(super) struct RunUp<'a> {
    pub(super) plan: &'a dyn Reference,
    /// Length of the way, s; 0 for a plan that begins at rest.
    pub(super) seconds: f64,
}

impl RunUp<'_> {
    /// The log of the plan alone, on its own clock.
    pub(super) fn without(&self, log: FlightLog) -> FlightLog {
        let first = (self.seconds / log.interval).round() as usize;
        let samples = log.samples.into_iter().skip(first);
        let samples =
            samples.map(|sample| paint_sim::flight::FlightSample { time: sample.time - self.seconds, ..sample });
        FlightLog { samples: samples.collect(), interval: log.interval }
    }
}

impl Reference for RunUp<'_> {
    fn duration(&self) -> f64 {
        self.seconds + self.plan.duration()
    }

    fn at(&self, t: f64) -> ReferenceState {
        let first = self.plan.at(0.0);
        if t >= self.seconds {
            return self.plan.at(t - self.seconds);
        }
        let s = (t / self.seconds).clamp(0.0, 1.0);
        let (back, share, slope) = entry(first.velocity, first.acceleration, self.seconds, s);
        ReferenceState {
            position: first.position + back,
            velocity: share,
            acceleration: slope,
            heading: first.heading - first.heading_rate * self.seconds * (0.5 - s.powi(3) + 0.5 * s.powi(4)),
            heading_rate: first.heading_rate * s * s * (3.0 - 2.0 * s),
            flow: 0.0,
            ..first
        }
    }
}

/// Place relative to the end, velocity and acceleration at the share `s` of a way of `seconds` that begins at rest without acceleration
/// and ends with velocity `v` and acceleration `a`: the cubic `v (3s^2 - 2s^3) + a T (s^3 - s^2)` in the velocity.
fn entry(v: Vector3<f64>, a: Vector3<f64>, seconds: f64, s: f64) -> (Vector3<f64>, Vector3<f64>, Vector3<f64>) {
    let at = a * seconds;
    let place = v * (s.powi(3) - 0.5 * s.powi(4) - 0.5) + at * (0.25 * s.powi(4) - s.powi(3) / 3.0 + 1.0 / 12.0);
    let velocity = v * (3.0 * s * s - 2.0 * s.powi(3)) + at * (s.powi(3) - s * s);
    let acceleration = v * (6.0 * s - 6.0 * s * s) + at * (3.0 * s * s - 2.0 * s);
    (place * seconds, velocity, acceleration / seconds)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;

    /// A curve that is in motion at its beginning: x = 1 + 0.3 t + 0.2 t^2, turning by 0.4 rad/s.
    struct Moving;

    impl Reference for Moving {
        fn duration(&self) -> f64 {
            2.0
        }

        fn at(&self, t: f64) -> ReferenceState {
            ReferenceState {
                position: Point3::new(1.0 + 0.3 * t + 0.2 * t * t, 0.0, 2.0),
                velocity: Vector3::x() * (0.3 + 0.4 * t),
                acceleration: Vector3::x() * 0.4,
                heading: 0.1 + 0.4 * t,
                heading_rate: 0.4,
                lever: Vector3::zeros(),
                aim: None,
                nozzle_distance: 0.1,
                flow: 1e-7,
            }
        }
    }

    #[test]
    fn the_way_begins_at_rest_and_meets_the_plan_with_its_speed_and_acceleration() {
        let reference = RunUp { plan: &Moving, seconds: 1.5 };
        let (begin, before, after) = (reference.at(0.0), reference.at(1.5 - 1e-9), reference.at(1.5));
        assert_eq!(
            (begin.velocity.norm(), begin.acceleration.norm(), begin.heading_rate, begin.flow),
            (0.0, 0.0, 0.0, 0.0)
        );
        assert!((before.position - after.position).norm() < 1e-8 && (before.velocity - after.velocity).norm() < 1e-8);
        assert!((before.acceleration - after.acceleration).norm() < 1e-7);
        assert!(
            (before.heading - after.heading).abs() < 1e-8 && (before.heading_rate - after.heading_rate).abs() < 1e-8
        );
        // Velocities and accelerations are the slopes of what they belong to.
        let h = 1e-5;
        for k in 1..15 {
            let t = 0.1 * f64::from(k) - 0.03;
            let (a, b, c) = (reference.at(t - h), reference.at(t), reference.at(t + h));
            assert!(((c.position - a.position) / (2.0 * h) - b.velocity).norm() < 1e-7, "at {t}");
            assert!(((c.velocity - a.velocity) / (2.0 * h) - b.acceleration).norm() < 1e-7, "at {t}");
            assert!(((c.heading - a.heading) / (2.0 * h) - b.heading_rate).abs() < 1e-7, "at {t}");
        }
        assert_eq!(reference.duration(), 3.5);
    }
}
