//! One inequality row of the interior-point method.
//!
//! A hard row is `a.q + s = b` with slack `s` and multiplier `z`, `s z -> 0`. A soft one is `a.q - e + s = b` with the relaxation `e`,
//! `e v -> 0` with `v = penalty - z`. Steps are written such that nothing small is a difference of large numbers: what a row sees of a
//! step is added to what it sees of the state, as a slack may be as small as the last digit of a position.

use super::quadratic_program::Row;
use nalgebra::{Vector2, Vector3};

/// Least slack of a start.
const LEAST_SLACK: f64 = 1e-3;

/// What the rows of one state add up to, on `N` coordinates.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sums<const N: usize, const M: usize> {
    /// `A' z`.
    pub(super) held: [f64; N],
    /// What the rows put on the right-hand side of the step towards complementarity zero, `A' z` included.
    pub(super) pull: [f64; N],
    /// Lower triangle of the curvature, column by column.
    pub(super) curvature: [f64; M],
}

impl<const N: usize, const M: usize> Sums<N, M> {
    pub(super) fn zero() -> Self {
        Self { held: [0.0; N], pull: [0.0; N], curvature: [0.0; M] }
    }

    #[inline]
    fn add(&mut self, a: &[f64; N], z: f64, pull: f64, stiffness: f64) {
        let mut place = 0;
        for r in 0..N {
            self.held[r] += a[r] * z;
            self.pull[r] += a[r] * pull;
            let scaled = a[r] * stiffness;
            for other in &a[r..] {
                self.curvature[place] += scaled * other;
                place += 1;
            }
        }
    }
}

/// What decides whether an iterate is the solution.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Residuals {
    /// Products of slacks and multipliers.
    pub(super) gap: f64,
    /// The greatest of them.
    pub(super) worst: f64,
    /// Greatest violation of a row's equation.
    pub(super) primal: f64,
}

/// A step of one state from `at`: `predicted` leads towards complementarity zero, the correction adds what leads to products of `target`
/// instead; `length` is the share of both that is gone.
///
/// Rows keep no steps of their own: memory is what a long solve waits for, and a step is found again by a division.
#[derive(Debug, Clone, Copy)]
pub(super) struct Step<V> {
    pub(super) at: V,
    pub(super) predicted: V,
    pub(super) correction: V,
    pub(super) target: f64,
    pub(super) length: f64,
}

/// How far a step may go (the inverse of the way to the boundary), and the products of its changes.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Reach {
    pub(super) inverse: f64,
    pub(super) cross: f64,
}

/// A hard row, on the position.
#[derive(Debug, Clone, Copy)]
pub(super) struct HardRow {
    a: [f64; 3],
    b: f64,
    s: f64,
    z: f64,
}

impl HardRow {
    /// Its product at `mu` where the slack allows. Positions count from `p`.
    pub(super) fn new(row: &Row, p: &Vector3<f64>, mu: f64) -> Self {
        let b = row.b - row.a.dot(p);
        let s = b.max(LEAST_SLACK);
        Self { a: row.a.into(), b, s, z: mu / s }
    }

    /// Goes the step at last, and adds the rows up at the position `p` where that ends.
    #[inline]
    pub(super) fn advance(
        &mut self,
        step: &Step<Vector3<f64>>,
        p: &Vector3<f64>,
        sums: &mut Sums<3, 6>,
        at: &mut Residuals,
    ) {
        let [ds, dz] = self.change(step, 1.0 / self.s);
        let (s, z) = (self.s + step.length * ds, self.z + step.length * dz);
        (self.s, self.z) = (s, z);
        let y = self.along(p) - self.b;
        at.primal = at.primal.max((y + s).abs());
        at.gap += s * z;
        at.worst = at.worst.max(s * z);
        let stiffness = z / s;
        sums.add(&self.a, z, z + stiffness * y, stiffness);
    }

    /// How far the step towards complementarity zero may go.
    #[inline]
    pub(super) fn predict(&self, step: &Step<Vector3<f64>>, reach: &mut Reach) {
        let t = self.ahead(step) / self.s;
        reach.inverse = reach.inverse.max((1.0 + t).max(-t));
        reach.cross += -(self.s * (1.0 + t) * self.z * t);
    }

    /// What the rows add to the right-hand side for products of `target` instead, second order included.
    #[inline]
    pub(super) fn correct(&self, step: &Step<Vector3<f64>>, pull: &mut [f64; 3]) {
        let inverse = 1.0 / self.s;
        let t = self.ahead(step) * inverse;
        let force = step.target * inverse + (1.0 + t) * self.z * t;
        for (pull, a) in pull.iter_mut().zip(&self.a) {
            *pull += a * force;
        }
    }

    /// How far the corrected step may go.
    #[inline]
    pub(super) fn finish(&self, step: &Step<Vector3<f64>>, reach: &mut f64) {
        let inverse = 1.0 / self.s;
        let [ds, dz] = self.change(step, inverse);
        *reach = reach.max((-ds * inverse).max(-dz / self.z));
    }

    #[inline]
    fn along(&self, p: &Vector3<f64>) -> f64 {
        self.a[0] * p.x + self.a[1] * p.y + self.a[2] * p.z
    }

    /// `a.q - b` where the step towards zero ends.
    #[inline]
    fn ahead(&self, step: &Step<Vector3<f64>>) -> f64 {
        self.along(&step.at) - self.b + self.along(&step.predicted)
    }

    /// Changes of slack and multiplier.
    #[inline]
    fn change(&self, step: &Step<Vector3<f64>>, inverse: f64) -> [f64; 2] {
        let t = self.ahead(step) * inverse;
        let moved = self.along(&step.correction);
        let rest = 1.0 + t;
        [-self.s * rest - moved, self.z * t * (rest + 1.0) + (self.z * moved + step.target) * inverse]
    }
}

/// A soft row, on the mapped coordinate.
#[derive(Debug, Clone, Copy)]
pub(super) struct SoftRow {
    a: [f64; 2],
    b: f64,
    s: f64,
    z: f64,
    e: f64,
}

/// The step of soft rows towards complementarity zero.
struct Predicted {
    /// Change of the multiplier as a share of it, and of what is left to the penalty.
    t: f64,
    q: f64,
    ds: f64,
    dz: f64,
    de: f64,
    /// `1 / (s v + e z)`.
    inverse: f64,
}

impl SoftRow {
    /// Coordinates count from `w`.
    pub(super) fn new(row: &Row, w: &Vector2<f64>, mu: f64, penalty: f64) -> Self {
        let b = row.b - row.a.xy().dot(w);
        let s = b.max(LEAST_SLACK);
        let z = (mu / s).min(0.5 * penalty);
        Self { a: row.a.xy().into(), b, s, z, e: mu / (penalty - z) }
    }

    /// The relaxation.
    pub(super) fn relaxation(&self) -> f64 {
        self.e
    }

    /// As [`HardRow::advance`], at the coordinate `w`.
    #[inline]
    pub(super) fn advance(
        &mut self,
        step: &Step<Vector2<f64>>,
        penalty: f64,
        w: &Vector2<f64>,
        sums: &mut Sums<2, 3>,
        at: &mut Residuals,
    ) {
        let [ds, dz, de] = self.change(step, penalty);
        let (s, z, e) = (self.s + step.length * ds, self.z + step.length * dz, self.e + step.length * de);
        (self.s, self.z, self.e) = (s, z, e);
        let v = penalty - z;
        let y = self.along(w) - self.b;
        at.primal = at.primal.max((y - e + s).abs());
        at.gap += s * z + e * v;
        at.worst = at.worst.max(s * z).max(e * v);
        let stiffness = z * v / (s * v + e * z);
        sums.add(&self.a, z, z + stiffness * y, stiffness);
    }

    /// As [`HardRow::predict`].
    #[inline]
    pub(super) fn predict(&self, penalty: f64, step: &Step<Vector2<f64>>, reach: &mut Reach) {
        let Predicted { t, q, ds, dz, de, .. } = self.towards_zero(step, penalty);
        reach.inverse = reach.inverse.max((1.0 + t).max(-t)).max((1.0 - q).max(q));
        reach.cross += (ds - de) * dz;
    }

    /// As [`HardRow::correct`].
    #[inline]
    pub(super) fn correct(&self, penalty: f64, step: &Step<Vector2<f64>>, pull: &mut [f64; 2]) {
        let Predicted { ds, dz, de, inverse, .. } = self.towards_zero(step, penalty);
        let force = ((penalty - self.z) * (step.target - ds * dz) - self.z * (step.target + de * dz)) * inverse;
        for (pull, a) in pull.iter_mut().zip(&self.a) {
            *pull += a * force;
        }
    }

    /// As [`HardRow::finish`].
    #[inline]
    pub(super) fn finish(&self, penalty: f64, step: &Step<Vector2<f64>>, reach: &mut f64) {
        let [ds, dz, de] = self.change(step, penalty);
        *reach = reach.max((-ds / self.s).max(-dz / self.z)).max((-de / self.e).max(dz / (penalty - self.z)));
    }

    #[inline]
    fn along(&self, w: &Vector2<f64>) -> f64 {
        self.a[0] * w.x + self.a[1] * w.y
    }

    /// The step towards complementarity zero.
    #[inline]
    fn towards_zero(&self, step: &Step<Vector2<f64>>, penalty: f64) -> Predicted {
        let v = penalty - self.z;
        let inverse = 1.0 / (self.s * v + self.e * self.z);
        let y = (self.along(&step.at) - self.b + self.along(&step.predicted)) * inverse;
        let (t, q) = (v * y, self.z * y);
        Predicted { t, q, ds: -self.s * (1.0 + t), dz: self.z * t, de: self.e * (q - 1.0), inverse }
    }

    /// Changes of slack, multiplier and relaxation.
    #[inline]
    fn change(&self, step: &Step<Vector2<f64>>, penalty: f64) -> [f64; 3] {
        let v = penalty - self.z;
        let Predicted { ds, dz, de, inverse, .. } = self.towards_zero(step, penalty);
        let moved = self.along(&step.correction);
        let relaxation = step.target + de * dz;
        let change = (v * (self.z * moved + step.target - ds * dz) - self.z * relaxation) * inverse;
        let more = (relaxation + self.e * change) / v;
        [ds + more - moved, dz + change, de + more]
    }
}
