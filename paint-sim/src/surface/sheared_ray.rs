//! The watertight test of a ray and a triangle of Woop, Benthin and Wald (2013), in f64.

use nalgebra::{Point3, Vector3};
use parry3d_f64::partitioning::BvhNode;

/// A ray in coordinates where it runs along the third axis: edge tests become 2D and exactly antisymmetric.
pub(super) struct ShearedRay {
    origin: Vector3<f64>,
    axes: [usize; 3],
    shear: Vector3<f64>,
    /// One over the direction; huge instead of infinite, since zero times it must stay a number.
    inverse: Vector3<f64>,
}

impl ShearedRay {
    pub(super) fn new(origin: &Point3<f64>, direction: &Vector3<f64>) -> Option<Self> {
        let main = direction.iamax();
        let along = direction[main];
        if !(along.abs() > 0.0 && along.is_finite()) {
            return None;
        }
        let axes = [(main + 1) % 3, (main + 2) % 3, main];
        let shear = Vector3::new(direction[axes[0]] / along, direction[axes[1]] / along, 1.0 / along);
        let inverse = direction.map(|d| 1.0 / if d.abs() > 1e-300 { d } else { 1e-300 });
        Some(Self { origin: origin.coords, axes, shear, inverse })
    }

    /// Distance at which the ray enters a box, where it does so before `max`.
    pub(super) fn entry_distance(&self, node: &BvhNode, max: f64) -> Option<f64> {
        let (low, high) = (node.mins(), node.maxs());
        let between = |low: f64, high: f64, i: usize| {
            let (a, b) = ((low - self.origin[i]) * self.inverse[i], (high - self.origin[i]) * self.inverse[i]);
            (a.min(b), a.max(b))
        };
        let (x, y, z) = (between(low.x, high.x, 0), between(low.y, high.y, 1), between(low.z, high.z, 2));
        let first = x.0.max(y.0).max(z.0).max(0.0);
        let last = x.1.min(y.1).min(z.1).min(max);
        (first <= last).then_some(first)
    }

    /// Distance and barycentric weights of the second and third corner, where the ray meets the triangle before `max`.
    pub(super) fn intersect(&self, triangle: &[Vector3<f64>; 3], max: f64) -> Option<(f64, [f64; 2])> {
        let [kx, ky, kz] = self.axes;
        let [a, b, c] = triangle.map(|corner| {
            let p = corner - self.origin;
            Vector3::new(p[kx] - self.shear.x * p[kz], p[ky] - self.shear.y * p[kz], self.shear.z * p[kz])
        });
        let u = c.x * b.y - c.y * b.x;
        let v = a.x * c.y - a.y * c.x;
        let w = b.x * a.y - b.y * a.x;
        if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
            return None;
        }
        let determinant = u + v + w;
        if determinant == 0.0 {
            return None;
        }
        let distance = (u * a.z + v * b.z + w * c.z) / determinant;
        (distance >= 0.0 && distance <= max).then(|| (distance, [v / determinant, w / determinant]))
    }
}
