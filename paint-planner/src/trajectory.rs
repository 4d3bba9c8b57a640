//! Minimum-snap trajectories of position and heading, with certified extrema.

mod sample;
mod segment;

use crate::bernstein::Bernstein;
use crate::error::Error;
use crate::minimum_snap::{KnotDerivatives, knot_derivatives};
use nalgebra::Vector4;
pub use sample::{Extrema, Sample};
pub(crate) use segment::Segment;

/// Fraction by which certified bounds may lie above the true maxima.
pub(crate) const TIGHT: f64 = 1e-6;
/// The same where those of the coefficients will do.
pub(crate) const COARSE: f64 = 1e6;

/// A piecewise polynomial path of degree 7 in x, y, z and heading, and a time law along it. It ends at rest; it begins at rest as well,
/// unless it continues another in flight.
///
/// As [`minimum_snap`](Self::minimum_snap) makes it, the polynomials are those of time and the snap is continuous. A planner flies the
/// same path in its own time, `dt/ds` a quadratic spline: the acceleration stays continuous, its slope jumps at the knots.
#[derive(Debug, Clone, PartialEq)]
pub struct Trajectory {
    /// Times of the knots, s, from 0.
    times: Vec<f64>,
    segments: Vec<Segment>,
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
                let path = hermite(&stretch[i], &derivatives[i], &stretch[i + 1], &derivatives[i + 1], t);
                segments.push(Segment::new(&path, &Bernstein::new(&[t])));
            }
            first = last;
        }
        Ok(Self::of_segments(segments))
    }

    /// Segments in order of time.
    pub(crate) fn of_segments(segments: Vec<Segment>) -> Self {
        let ends = segments.iter().scan(0.0, |sum, segment| {
            *sum += segment.duration();
            Some(*sum)
        });
        Self { times: std::iter::once(0.0).chain(ends).collect(), segments }
    }

    pub(crate) fn segments(&self) -> &[Segment] {
        &self.segments
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
        let (segment, time) = self.locate(t);
        segment.sample(time)
    }

    /// Velocity, acceleration and jerk at time `t`, clamped to the duration: what a trajectory that continues this one begins with.
    pub(crate) fn motion(&self, t: f64) -> KnotDerivatives {
        let (segment, time) = self.locate(t);
        segment.motion(time).1
    }

    /// Segment of time `t`, and the time since its beginning, s.
    fn locate(&self, t: f64) -> (&Segment, f64) {
        let t = if t.is_finite() { t.clamp(0.0, self.duration()) } else { 0.0 };
        let i = self.times.partition_point(|&knot| knot <= t).clamp(1, self.segments.len()) - 1;
        (&self.segments[i], t - self.times[i])
    }

    /// Certified extrema over the whole trajectory.
    pub fn extrema(&self) -> Extrema {
        self.bounds(TIGHT)
    }

    /// The same, above the true maxima by a fraction of `tight` at most.
    pub(crate) fn bounds(&self, tight: f64) -> Extrema {
        self.segments.iter().fold(Extrema::default(), |most, segment| segment.extrema(&most, tight))
    }

    /// Bounds between two times, those of the segments about them: a little too high.
    pub(crate) fn bounds_between(&self, [from, to]: [f64; 2]) -> Extrema {
        let first = self.times.partition_point(|&knot| knot <= from).clamp(1, self.segments.len()) - 1;
        let about = self.segments[first..].iter().zip(&self.times[first..]).take_while(|(_, begin)| **begin < to);
        about.fold(Extrema::default(), |most, (segment, _)| segment.extrema(&most, COARSE))
    }

    /// The same path flown `k` times slower: speeds divide by `k`, accelerations by `k^2`.
    pub(crate) fn stretched(mut self, k: f64) -> Self {
        self.times.iter_mut().for_each(|time| *time *= k);
        self.segments.iter_mut().for_each(|segment| *segment = segment.stretched(k));
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
            seen = Extrema {
                speed: seen.speed.max(sample.velocity.norm()),
                acceleration: seen.acceleration.max(sample.acceleration.norm()),
                heading_rate: seen.heading_rate.max(sample.heading_rate.abs()),
            };
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
