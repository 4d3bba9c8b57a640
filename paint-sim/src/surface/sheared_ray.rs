//! The watertight test of a ray and a triangle of Woop, Benthin and Wald (2013), in f64.

use nalgebra::{Point3, Vector3};
use parry3d_f64::partitioning::BvhNode;

/// A ray in coordinates where it runs along the third axis: edge tests become 2D and exactly antisymmetric.
pub(super) struct ShearedRay {
    origin: Vector3<f64>,
    /// Which axis becomes the third one.
    main: usize,
    shear: Vector3<f64>,
}

/// A ray as boxes see it.
pub(super) struct SlabRay {
    origin: Vector3<f64>,
    /// One over the direction; huge instead of infinite, since zero times it must stay a number.
    inverse: Vector3<f64>,
}

impl ShearedRay {
    pub(super) fn new(origin: &Point3<f64>, direction: &Vector3<f64>) -> Option<Self> {
        let [x, y, z] = [direction.x, direction.y, direction.z];
        let size = direction.abs();
        let main = if size.x >= size.y && size.x >= size.z { 0 } else { 1 + usize::from(size.z > size.y) };
        let [x, y, along] = turned(main, x, y, z);
        if !(along.abs() > 0.0 && along.is_finite()) {
            return None;
        }
        Some(Self { origin: origin.coords, main, shear: Vector3::new(x / along, y / along, 1.0 / along) })
    }

    /// Distance and barycentric weights of the second and third corner, where the ray meets the triangle before `max`.
    pub(super) fn intersect(&self, triangle: &[Vector3<f64>; 3], max: f64) -> Option<(f64, [f64; 2])> {
        let sheared = |corner: &Vector3<f64>| {
            let p = corner - self.origin;
            let [x, y, z] = turned(self.main, p.x, p.y, p.z);
            Vector3::new(x - self.shear.x * z, y - self.shear.y * z, self.shear.z * z)
        };
        let [a, b, c] = [sheared(&triangle[0]), sheared(&triangle[1]), sheared(&triangle[2])];
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

/// Coordinates in cyclic order, so that the main one comes last.
#[inline(always)]
fn turned(main: usize, x: f64, y: f64, z: f64) -> [f64; 3] {
    match main {
        0 => [y, z, x],
        1 => [z, x, y],
        _ => [x, y, z],
    }
}

impl SlabRay {
    pub(super) fn new(origin: &Point3<f64>, direction: &Vector3<f64>) -> Self {
        let inverse = direction.map(|d| 1.0 / if d.abs() > 1e-300 { d } else { 1e-300 });
        Self { origin: origin.coords, inverse }
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
}
