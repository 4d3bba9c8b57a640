//! What a world is made of.

use nalgebra::{Point3, Vector3};

/// Nearest that a ray meets anything.
const LEAST: f64 = 1e-6;

/// A solid of the world, metres, z up.
#[derive(Debug, Clone, Copy)]
pub(super) enum Solid {
    /// Low and high corner.
    Box([f64; 3], [f64; 3]),
    /// Centre and radius.
    Ball([f64; 3], f64),
    /// Upright: x and y of its axis, its foot and its head, and its radius.
    Pole([f64; 2], [f64; 2], f64),
}

impl Solid {
    /// The `t` at which `o + t d` enters it, where `o` is outside.
    pub(super) fn hit(&self, o: &Point3<f64>, d: &Vector3<f64>) -> Option<f64> {
        match *self {
            Self::Box(low, high) => {
                let (near, far) = slabs(o, d, &low, &high);
                (near < far && near > LEAST).then_some(near)
            }
            Self::Ball(centre, radius) => {
                let to = o - Point3::from(centre);
                first_root(d.norm_squared(), to.dot(d), to.norm_squared() - radius * radius)
            }
            Self::Pole([x, y], [foot, head], radius) => {
                let (bx, by) = (o.x - x, o.y - y);
                let side = first_root(d.x * d.x + d.y * d.y, bx * d.x + by * d.y, bx * bx + by * by - radius * radius);
                let side = side.filter(|t| (foot..=head).contains(&(o.z + t * d.z)));
                let top = (head - o.z) / d.z;
                let on_top = d.z < 0.0 && top > LEAST && (bx + top * d.x).hypot(by + top * d.y) <= radius;
                side.or(on_top.then_some(top))
            }
        }
    }

    /// Centre and radius of a ball around it.
    pub(super) fn bounds(&self) -> (Point3<f64>, f64) {
        match *self {
            Self::Box(low, high) => {
                let [low, high] = [low, high].map(Point3::from);
                (nalgebra::center(&low, &high), (high - low).norm() / 2.0)
            }
            Self::Ball(centre, radius) => (centre.into(), radius),
            Self::Pole([x, y], [foot, head], radius) => {
                (Point3::new(x, y, f64::midpoint(foot, head)), radius.hypot((head - foot) / 2.0))
            }
        }
    }

    /// Distance of a point in the air.
    pub(super) fn distance(&self, p: &Point3<f64>) -> f64 {
        match *self {
            Self::Box(low, high) => {
                let out = |k: usize| (p[k] - f64::midpoint(low[k], high[k])).abs() - (high[k] - low[k]) / 2.0;
                rounded(&[out(0), out(1), out(2)])
            }
            Self::Ball(centre, radius) => (p - Point3::from(centre)).norm() - radius,
            Self::Pole([x, y], [foot, head], radius) => {
                let along = (p.z - f64::midpoint(foot, head)).abs() - (head - foot) / 2.0;
                rounded(&[(p.x - x).hypot(p.y - y) - radius, along])
            }
        }
    }
}

/// Between which `t` a ray is in a box.
fn slabs(o: &Point3<f64>, d: &Vector3<f64>, low: &[f64; 3], high: &[f64; 3]) -> (f64, f64) {
    let mut bounds = (f64::NEG_INFINITY, f64::INFINITY);
    for k in 0..3 {
        let [a, b] = [(low[k] - o[k]) / d[k], (high[k] - o[k]) / d[k]];
        bounds = (bounds.0.max(a.min(b)), bounds.1.min(a.max(b)));
    }
    bounds
}

/// The first of the roots of `a t² + 2 b t + c`, if it lies ahead.
fn first_root(a: f64, b: f64, c: f64) -> Option<f64> {
    let root = b * b - a * c;
    (root >= 0.0).then(|| (-b - root.sqrt()) / a).filter(|t| *t > LEAST)
}

/// How far a point is out of a product of intervals, by how far it is out of each; negative inside.
fn rounded(out: &[f64]) -> f64 {
    let beyond = out.iter().map(|v| v.max(0.0).powi(2)).sum::<f64>().sqrt();
    beyond + out.iter().copied().fold(f64::NEG_INFINITY, f64::max).min(0.0)
}
