//! One piece of a trajectory: a polynomial path and the time law along it.

use super::sample::{Extrema, Sample};
use crate::bernstein::Bernstein;
use crate::minimum_snap::KnotDerivatives;
use nalgebra::{Point3, Vector4};

/// Newton steps to the parameter at a time; the time law is monotone and nearly linear.
const NEWTON: usize = 12;

/// A path `q(s)`, s from 0 to 1, along which time passes at the rate `dt/ds`. Held by its coefficients alone, as flights have millions of them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Segment {
    /// Bernstein coefficients of x, y, z in m, heading in rad.
    path: [[f64; 8]; 4],
    /// Those of `dt/ds`, s: greater than 0, all the same where time passes evenly.
    slowness: [f64; 3],
}

impl Segment {
    /// Of a path of degree 7 at most, and `dt/ds` of degree 0 or 2.
    pub(crate) fn new(path: &[Bernstein; 4], slowness: &Bernstein) -> Self {
        Self {
            path: path.each_ref().map(Bernstein::coefficients_of_degree),
            slowness: slowness.coefficients_of_degree(),
        }
    }

    /// x, y, z in m, heading in rad.
    pub(crate) fn path(&self) -> [Bernstein; 4] {
        self.path.map(|axis| Bernstein::new(&axis))
    }

    fn slowness(&self) -> Bernstein {
        Bernstein::new(if self.is_even() { &self.slowness[..1] } else { &self.slowness })
    }

    /// Whether time passes evenly.
    fn is_even(&self) -> bool {
        let [first, middle, last] = self.slowness;
        first == middle && middle == last
    }

    /// How long it is flown, s.
    pub(crate) fn duration(&self) -> f64 {
        self.time(1.0)
    }

    /// Time since its beginning at `s`, s.
    pub(crate) fn time(&self, s: f64) -> f64 {
        let [a, b, c] = self.slowness;
        if self.is_even() { a * s } else { derivatives([0.0, a / 3.0, (a + b) / 3.0, (a + b + c) / 3.0], s)[0] }
    }

    /// The share `s` of the path at a time since its beginning, the inverse of [`time`](Self::time).
    fn parameter(&self, time: f64) -> f64 {
        let mut s = (time / self.duration()).clamp(0.0, 1.0);
        if self.is_even() {
            return s;
        }
        for _ in 0..NEWTON {
            let step = (time - self.time(s)) / derivatives(self.slowness, s)[0];
            s = (s + step).clamp(0.0, 1.0);
            if step.abs() < 1e-15 {
                break;
            }
        }
        s
    }

    /// The vehicle at a time since the beginning.
    pub(crate) fn sample(&self, time: f64) -> Sample {
        let (value, motion) = self.motion(time);
        let row = |r: usize| motion.fixed_view::<1, 3>(r, 0).transpose();
        Sample {
            position: Point3::from(value.xyz()),
            velocity: row(0),
            acceleration: row(1),
            heading: value.w,
            heading_rate: motion[(0, 3)],
        }
    }

    /// Place, and velocity, acceleration and jerk, at a time since the beginning.
    pub(crate) fn motion(&self, time: f64) -> (Vector4<f64>, KnotDerivatives) {
        let s = self.parameter(time);
        let [w, w1, w2, _] = derivatives(self.slowness, s);
        let (mut value, mut motion) = (Vector4::zeros(), KnotDerivatives::zeros());
        for (axis, path) in self.path.iter().enumerate() {
            let [q, q1, q2, q3] = derivatives(*path, s);
            value[axis] = q;
            // d/dt = (1/w) d/ds, again and again.
            motion[(0, axis)] = q1 / w;
            motion[(1, axis)] = (q2 - q1 * w1 / w) / w.powi(2);
            motion[(2, axis)] = (q3 - (q1 * w2 + 3.0 * w1 * (q2 - q1 * w1 / w)) / w) / w.powi(3);
        }
        (value, motion)
    }

    /// Certified extrema of the segment, above the true ones by a fraction of `tight` at most, and no less than `floor`: what is below need
    /// not be resolved.
    pub(crate) fn extrema(&self, floor: &Extrema, tight: f64) -> Extrema {
        let (rates, slowness) = (self.path().map(|path| path.derivative()), self.slowness());
        let square = slowness.product(&slowness);
        let root = |squares: Bernstein, below: Bernstein, floor: f64| {
            squares.greatest_ratio(&below.elevated(squares.degree()), floor * floor, tight).sqrt()
        };
        // The acceleration is q''/w^2, or (q'' w - q' w')/w^3 where w changes.
        let second = |axis: usize| {
            let second = rates[axis].derivative();
            match slowness.degree() {
                0 => second,
                _ => second.product(&slowness).minus(&rates[axis].product(&slowness.derivative())),
            }
        };
        let fourth = square.product(&square);
        let below = if slowness.degree() == 0 { fourth } else { fourth.product(&square) };
        Extrema {
            speed: root(Bernstein::sum_of_squares(&rates[..3]), square, floor.speed),
            acceleration: root(Bernstein::sum_of_squares(&[0, 1, 2].map(second)), below, floor.acceleration),
            heading_rate: root(Bernstein::sum_of_squares(&rates[3..]), square, floor.heading_rate),
        }
    }

    /// The same path flown `k` times slower.
    pub(crate) fn stretched(&self, k: f64) -> Self {
        Self { slowness: self.slowness.map(|slowness| k * slowness), ..*self }
    }
}

/// Value and first three derivatives of a polynomial of degree `N - 1` by its Bernstein coefficients: de Casteljau's scheme, whose last rows hold
/// them as differences.
#[inline(always)]
fn derivatives<const N: usize>(mut row: [f64; N], s: f64) -> [f64; 4] {
    // n! / (n - k)! of the degree n.
    let mut found = [1.0; 4];
    for order in 1..4 {
        found[order] = found[order - 1] * (N as f64 - order as f64);
    }
    for last in (0..N).rev() {
        match last {
            3 => found[3] *= row[3] - 3.0 * (row[2] - row[1]) - row[0],
            2 => found[2] *= row[2] - 2.0 * row[1] + row[0],
            1 => found[1] *= row[1] - row[0],
            0 => found[0] *= row[0],
            _ => {}
        }
        for k in 0..last {
            row[k] += s * (row[k + 1] - row[k]);
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Paths s^3, (s - 1)^2, 2 s and 5 along which time passes as t = s + s^3, so that w = dt/ds = 1 + 3 s^2. The derivatives of s by t
    /// are then 1/w, -w'/w^3 and (3 w'^2 - 6 w)/w^5.
    #[test]
    fn motion_is_that_of_the_chain_rule() {
        let path = [&[0.0, 0.0, 0.0, 1.0][..], &[1.0, 0.0, 0.0], &[0.0, 2.0], &[5.0]].map(Bernstein::new);
        let segment = Segment::new(&path, &Bernstein::new(&[1.0, 1.0, 4.0]));
        assert!((segment.duration() - 2.0).abs() < 1e-14);
        for s in [0.0_f64, 0.2, 0.5, 0.9] {
            let (w, w1) = (1.0 + 3.0 * s * s, 6.0 * s);
            let (a, b, c) = (1.0 / w, -w1 / w.powi(3), (3.0 * w1 * w1 - 6.0 * w) / w.powi(5));
            let (value, motion) = segment.motion(s + s.powi(3));
            let places = [s.powi(3), (s - 1.0).powi(2), 2.0 * s, 5.0];
            let slopes = [[3.0 * s * s, 6.0 * s, 6.0], [2.0 * (s - 1.0), 2.0, 0.0], [2.0, 0.0, 0.0], [0.0; 3]];
            for (axis, [q1, q2, q3]) in slopes.into_iter().enumerate() {
                let third = q3 * a * a * a + 3.0 * q2 * a * b + q1 * c;
                for (row, expected) in [q1 * a, q2 * a * a + q1 * b, third].into_iter().enumerate() {
                    let found = motion[(row, axis)];
                    assert!((found - expected).abs() < 1e-10, "s {s}, axis {axis}, order {row}: {found} {expected}");
                }
                assert!((value[axis] - places[axis]).abs() < 1e-12);
            }
        }
    }
}
