//! Minimum-snap trajectories of position and heading, with certified extrema.

use crate::bernstein::Bernstein;
use crate::error::Error;
use crate::minimum_snap::{KnotDerivatives, knot_derivatives};
use nalgebra::{Point3, Vector3, Vector4};

/// The vehicle at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Body origin in the world, m.
    pub position: Point3<f64>,
    /// Velocity in the world, m/s.
    pub velocity: Vector3<f64>,
    /// Acceleration in the world, m/s^2.
    pub acceleration: Vector3<f64>,
    /// Heading about world z, rad, continuous (not wrapped).
    pub heading: f64,
    /// Heading rate, rad/s.
    pub heading_rate: f64,
}

/// Certified bounds over a stretch of trajectory: never below the true maxima, and above them by at most 1e-6 of them.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Extrema {
    /// Greatest speed, m/s.
    pub speed: f64,
    /// Greatest acceleration, m/s^2.
    pub acceleration: f64,
    /// Greatest absolute heading rate, rad/s.
    pub heading_rate: f64,
}

impl Extrema {
    /// The larger of both, field by field.
    pub(crate) fn max(self, other: Self) -> Self {
        Self {
            speed: self.speed.max(other.speed),
            acceleration: self.acceleration.max(other.acceleration),
            heading_rate: self.heading_rate.max(other.heading_rate),
        }
    }
}

/// A piecewise polynomial of degree 7 in x, y, z and heading, with continuous snap between its knots. It ends at rest; it begins at
/// rest as well, unless it continues another in flight.
#[derive(Debug, Clone, PartialEq)]
pub struct Trajectory {
    /// Times of the knots, s, from 0.
    times: Vec<f64>,
    /// Per segment and axis the Bernstein coefficients over the segment.
    segments: Vec<[Bernstein; 4]>,
}

impl Trajectory {
    /// The curve through `points` (x, y, z in m, unwrapped heading in rad) that minimises the integrated squared snap of
    /// all four axes for the given segment durations in s. `rest[i]` stops it at knot i; both ends always rest.
    pub fn minimum_snap(points: &[Vector4<f64>], durations: &[f64], rest: &[bool]) -> Result<Self, Error> {
        Self::minimum_snap_from(&KnotDerivatives::zeros(), points, durations, rest)
    }

    /// The same with velocity, acceleration and jerk at the first knot.
    pub(crate) fn minimum_snap_from(
        start: &KnotDerivatives,
        points: &[Vector4<f64>],
        durations: &[f64],
        rest: &[bool],
    ) -> Result<Self, Error> {
        if points.len() < 2 || durations.len() + 1 != points.len() || rest.len() != points.len() {
            return Err(Error::Knot { index: points.len(), what: "give at least two knots, one duration per segment" });
        }
        if let Some(index) = points.iter().position(|p| !p.iter().all(|c| c.is_finite())) {
            return Err(Error::Knot { index, what: "the knot must be finite" });
        }
        if let Some(index) = durations.iter().position(|t| !(t.is_finite() && *t > 0.0)) {
            return Err(Error::Knot { index, what: "the duration must be finite and greater than 0" });
        }
        let mut segments = Vec::with_capacity(durations.len());
        let mut first = 0;
        for last in 1..points.len() {
            if !(rest[last] || last + 1 == points.len()) {
                continue;
            }
            let (stretch, own) = (&points[first..=last], &durations[first..last]);
            let begin = if first == 0 { *start } else { KnotDerivatives::zeros() };
            let derivatives =
                knot_derivatives(stretch, own, &begin).ok_or(Error::Numerical { stage: "the minimum-snap system" })?;
            for (i, &t) in own.iter().enumerate() {
                segments.push(hermite(&stretch[i], &derivatives[i], &stretch[i + 1], &derivatives[i + 1], t));
            }
            first = last;
        }
        let mut times = vec![0.0];
        times.extend(durations.iter().scan(0.0, |sum, t| {
            *sum += t;
            Some(*sum)
        }));
        Ok(Self { times, segments })
    }

    /// Total time, s.
    pub fn duration(&self) -> f64 {
        self.times.last().copied().unwrap_or(0.0)
    }

    /// Times of the knots, s; the first is 0, the last the duration.
    pub fn knots(&self) -> &[f64] {
        &self.times
    }

    /// The vehicle at time `t`, clamped to the duration.
    pub fn sample(&self, t: f64) -> Sample {
        let (i, s, length) = self.locate(t);
        let (mut value, mut rate, mut second) = (Vector4::zeros(), Vector4::zeros(), Vector4::zeros());
        for (axis, curve) in self.segments[i].iter().enumerate() {
            let first = curve.derivative();
            value[axis] = curve.value(s);
            rate[axis] = first.value(s) / length;
            second[axis] = first.derivative().value(s) / (length * length);
        }
        Sample {
            position: Point3::from(value.xyz()),
            velocity: rate.xyz(),
            acceleration: second.xyz(),
            heading: value.w,
            heading_rate: rate.w,
        }
    }

    /// Velocity, acceleration and jerk at time `t`, clamped to the duration: what a trajectory that continues this one begins with.
    pub(crate) fn motion(&self, t: f64) -> KnotDerivatives {
        let (i, s, length) = self.locate(t);
        let mut motion = KnotDerivatives::zeros();
        for (axis, curve) in self.segments[i].iter().enumerate() {
            let first = curve.derivative();
            let second = first.derivative();
            motion[(0, axis)] = first.value(s) / length;
            motion[(1, axis)] = second.value(s) / length.powi(2);
            motion[(2, axis)] = second.derivative().value(s) / length.powi(3);
        }
        motion
    }

    /// Segment of time `t`, the share of it that has passed, and its length, s.
    fn locate(&self, t: f64) -> (usize, f64, f64) {
        let t = if t.is_finite() { t.clamp(0.0, self.duration()) } else { 0.0 };
        let i = self.times.partition_point(|&knot| knot <= t).clamp(1, self.segments.len()) - 1;
        let length = self.times[i + 1] - self.times[i];
        (i, ((t - self.times[i]) / length).clamp(0.0, 1.0), length)
    }

    /// Certified extrema of segment `i`, by subdivision of the Bernstein form of `|v|^2`, `|a|^2` and the heading rate.
    pub(crate) fn segment_extrema(&self, i: usize) -> Extrema {
        let length = self.times[i + 1] - self.times[i];
        let rates = self.segments[i].map(|curve| curve.derivative());
        let seconds = [rates[0].derivative(), rates[1].derivative(), rates[2].derivative()];
        let root = |squares: Bernstein| squares.maximum(0.0, 1e-6).sqrt();
        let turn = Bernstein::sum_of_squares(&rates[3..]);
        Extrema {
            speed: root(Bernstein::sum_of_squares(&rates[..3])) / length,
            acceleration: root(Bernstein::sum_of_squares(&seconds)) / (length * length),
            heading_rate: root(turn) / length,
        }
    }

    /// Certified extrema over the whole trajectory.
    pub fn extrema(&self) -> Extrema {
        (0..self.segments.len()).fold(Extrema::default(), |most, i| most.max(self.segment_extrema(i)))
    }

    /// The same path flown `k` times slower: speeds divide by `k`, accelerations by `k^2`.
    pub(crate) fn stretched(mut self, k: f64) -> Self {
        for time in &mut self.times {
            *time *= k;
        }
        self
    }
}

/// Bernstein coefficients of the degree-7 polynomials with the given derivatives at both ends.
fn hermite(
    start: &Vector4<f64>,
    out: &KnotDerivatives,
    end: &Vector4<f64>,
    into: &KnotDerivatives,
    t: f64,
) -> [Bernstein; 4] {
    std::array::from_fn(|axis| {
        let ladder = |p: f64, derivatives: &KnotDerivatives, t: f64| {
            let (v, a, j) =
                (derivatives[(0, axis)] * t, derivatives[(1, axis)] * t * t, derivatives[(2, axis)] * t * t * t);
            [p, p + v / 7.0, p + 2.0 * v / 7.0 + a / 42.0, p + 3.0 * v / 7.0 + a / 14.0 + j / 210.0]
        };
        let (a, b) = (ladder(start[axis], out, t), ladder(end[axis], into, -t));
        Bernstein::new(&[a[0], a[1], a[2], a[3], b[3], b[2], b[1], b[0]])
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wavy(count: usize) -> Trajectory {
        let points: Vec<Vector4<f64>> =
            (0..count).map(|i| Vector4::from_fn(|r, _| (0.9 * i as f64 + r as f64).sin() * 0.3)).collect();
        let durations: Vec<f64> = (1..count).map(|i| 0.5 + 0.4 * (i as f64).cos().abs()).collect();
        Trajectory::minimum_snap(&points, &durations, &vec![false; count]).unwrap()
    }

    #[test]
    fn rest_to_rest_matches_its_closed_form() {
        let (length, time) = (2.0, 3.0);
        let points = [Vector4::zeros(), Vector4::new(length, 0.0, 0.0, 0.0)];
        let curve = Trajectory::minimum_snap(&points, &[time], &[false; 2]).unwrap();
        for k in 0..=10 {
            let s = f64::from(k) / 10.0;
            let expected = length * (35.0 * s.powi(4) - 84.0 * s.powi(5) + 70.0 * s.powi(6) - 20.0 * s.powi(7));
            assert!((curve.sample(s * time).position.x - expected).abs() < 1e-12);
        }
        let extrema = curve.extrema();
        assert!((extrema.speed / (2.1875 * length / time) - 1.0).abs() < 1e-6);
        assert!((extrema.acceleration / (7.513188404 * length / time.powi(2)) - 1.0).abs() < 1e-6);
        assert_eq!(extrema.heading_rate, 0.0);
    }

    #[test]
    fn extrema_bound_every_sample_tightly() {
        let curve = wavy(12);
        let extrema = curve.extrema();
        let mut seen = Extrema::default();
        for k in 0..=200_000 {
            let sample = curve.sample(curve.duration() * f64::from(k) / 200_000.0);
            seen = seen.max(Extrema {
                speed: sample.velocity.norm(),
                acceleration: sample.acceleration.norm(),
                heading_rate: sample.heading_rate.abs(),
            });
        }
        for (bound, sampled) in [
            (extrema.speed, seen.speed),
            (extrema.acceleration, seen.acceleration),
            (extrema.heading_rate, seen.heading_rate),
        ] {
            assert!(bound >= sampled * (1.0 - 1e-12) && bound < sampled * (1.0 + 1e-5), "{bound} {sampled}");
        }
    }

    #[test]
    fn acceleration_is_continuous_and_the_derivative_of_velocity() {
        let curve = wavy(6);
        let h = 1e-5;
        for knot in &curve.knots()[1..5] {
            let (before, after) = (curve.sample(knot - 1e-9), curve.sample(knot + 1e-9));
            assert!((before.acceleration - after.acceleration).norm() < 1e-6);
            let slope = (curve.sample(knot + h).velocity - curve.sample(knot - h).velocity) / (2.0 * h);
            assert!((slope - curve.sample(*knot).acceleration).norm() < 1e-5);
        }
    }

    #[test]
    fn a_curve_continues_another_without_a_jump_of_any_derivative_up_to_the_jerk() {
        let before = wavy(6);
        let at = 0.6 * before.duration();
        let here = before.sample(at);
        let first = Vector4::new(here.position.x, here.position.y, here.position.z, here.heading);
        let points = [first, first + Vector4::repeat(0.2), first + Vector4::new(0.3, 0.5, 0.1, 0.2)];
        for knots in [2, 3] {
            let rest = vec![false; knots];
            let after =
                Trajectory::minimum_snap_from(&before.motion(at), &points[..knots], &[0.7, 0.9][..knots - 1], &rest)
                    .unwrap();
            assert!((after.sample(0.0).velocity - here.velocity).norm() < 1e-12);
            assert!((after.sample(0.0).acceleration - here.acceleration).norm() < 1e-10);
            assert!((after.sample(0.0).heading_rate - here.heading_rate).abs() < 1e-12);
            // The jerk on either side, as slopes of the accelerations there.
            let h = 1e-6;
            let out = (after.sample(h).acceleration - after.sample(0.0).acceleration) / h;
            let into = (before.sample(at).acceleration - before.sample(at - h).acceleration) / h;
            assert!((out - into).norm() < 1e-3 * into.norm(), "{out} {into}");
            assert!(after.motion(after.duration()).norm() < 1e-9);
        }
    }

    #[test]
    fn stretching_divides_speed_and_acceleration() {
        let (plain, slow) = (wavy(8).extrema(), wavy(8).stretched(2.0).extrema());
        assert!((plain.speed / slow.speed - 2.0).abs() < 1e-5);
        assert!((plain.acceleration / slow.acceleration - 4.0).abs() < 1e-5);
    }

    #[test]
    fn bad_knots_are_named() {
        let mut points = vec![Vector4::zeros(); 3];
        points[1].x = f64::NAN;
        let refused = Trajectory::minimum_snap(&points, &[1.0, 1.0], &[false; 3]);
        assert!(matches!(refused, Err(Error::Knot { index: 1, .. })));
        points[1].x = 1.0;
        let refused = Trajectory::minimum_snap(&points, &[1.0, 0.0], &[false; 3]);
        assert!(matches!(refused, Err(Error::Knot { index: 1, .. })));
    }
}
