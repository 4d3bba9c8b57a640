//! A triangle mesh with a bounding volume hierarchy: the ready implementation of [`Surface`].

use glam::DVec3;
use nalgebra::{Point3, Vector3};
use parry3d_f64::bounding_volume::Aabb;
use parry3d_f64::partitioning::{Bvh, BvhBuildStrategy, BvhNode, TraversalAction};
use parry3d_f64::query::PointQuery;
use parry3d_f64::shape::Triangle;

use super::ray_query::{Hit, Surface};
use crate::error::Error;

/// A triangle soup: open, unequal, duplicate and zero-area triangles are fine (the last are never hit).
///
/// Rays use the watertight test of Woop, Benthin and Wald (2013) in f64, so that none slips through an edge that two
/// triangles share.
#[derive(Debug, Clone)]
pub struct TriangleSurface {
    /// Corners of the triangles that have an area; the leaves of the tree count these.
    corners: Vec<[Vector3<f64>; 3]>,
    /// Index of the face of each of them.
    faces: Vec<u32>,
    tree: Bvh,
}

impl TriangleSurface {
    /// Builds the hierarchy from vertex positions (m, world frame) and faces (three vertex indices each).
    ///
    /// # Errors
    /// Empty lists, positions that are not finite, indices without a vertex, or no triangle with an area.
    pub fn new(positions: &[[f32; 3]], faces: &[[u32; 3]]) -> Result<Self, Error> {
        if positions.is_empty() {
            return Err(Error::Empty { what: "positions" });
        }
        if faces.is_empty() {
            return Err(Error::Empty { what: "faces" });
        }
        if let Some(index) = positions.iter().position(|p| p.iter().any(|v| !v.is_finite())) {
            return Err(Error::NotFinite { what: "position", index });
        }
        let mut surface = Self { corners: Vec::new(), faces: Vec::new(), tree: Bvh::new() };
        for (face, vertices) in faces.iter().enumerate() {
            let mut triangle = [Vector3::zeros(); 3];
            for (corner, &vertex) in triangle.iter_mut().zip(vertices) {
                let missing = Error::VertexIndex { face, vertex, vertices: positions.len() };
                *corner = Vector3::from(positions.get(vertex as usize).ok_or(missing)?.map(f64::from));
            }
            if scaled_normal(&triangle).norm_squared() > 0.0 {
                surface.corners.push(triangle);
                surface.faces.push(face as u32);
            }
        }
        if surface.corners.is_empty() {
            return Err(Error::NoArea { faces: faces.len() });
        }
        // Rounding in the box test must never cost a hit that the triangle test would find.
        let margin = surface.corners.iter().flatten().map(nalgebra::Matrix::amax).fold(0.0, f64::max) * 1e-12;
        let bounds = |[a, b, c]: &[Vector3<f64>; 3]| {
            let (low, high) = (a.inf(b).inf(c).add_scalar(-margin), a.sup(b).sup(c).add_scalar(margin));
            Aabb::new(vector(&low), vector(&high))
        };
        let boxes: Vec<Aabb> = surface.corners.iter().map(bounds).collect();
        surface.tree = Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes);
        Ok(surface)
    }

    /// Where a hit lies, m, world frame; `None` of a hit on another surface.
    pub fn point(&self, hit: &Hit) -> Option<Point3<f64>> {
        let [a, b, c] = &self.corners[self.faces.binary_search(&hit.face).ok()?];
        let [v, w] = hit.barycentric;
        Some((a * (1.0 - v - w) + b * v + c * w).into())
    }

    /// Corners of the triangle next to a point, m, in the order of its face; `None` if all are farther than `max`.
    pub fn nearest_triangle(&self, point: &Point3<f64>, max: f64) -> Option<[Point3<f64>; 3]> {
        let (leaf, _) = self.nearest(point, max)?;
        Some(self.corners[leaf as usize].map(Point3::from))
    }

    /// The triangle next to a point, and how far it is.
    fn nearest(&self, point: &Point3<f64>, max: f64) -> Option<(u32, f64)> {
        let query = vector(&point.coords);
        self.tree.find_best(
            max,
            |node, _| node.aabb().distance_to_local_point(query, true),
            |leaf, _| {
                let [a, b, c] = &self.corners[leaf as usize];
                let triangle = Triangle::new(vector(a), vector(b), vector(c));
                Some((triangle.project_local_point(query, true).point - query).length())
            },
        )
    }

    /// Least and largest coordinate along an axis, m.
    pub fn extent(&self, axis: &Vector3<f64>) -> (f64, f64) {
        let along = self.corners.iter().flatten().map(|corner| corner.dot(axis));
        along.fold((f64::MAX, f64::MIN), |(low, high), a| (low.min(a), high.max(a)))
    }
}

impl Surface for TriangleSurface {
    fn cast(&self, origin: &Point3<f64>, direction: &Vector3<f64>, max: f64) -> Option<Hit> {
        let ray = ShearedRay::new(origin, direction)?;
        let (leaf, (distance, barycentric)) = self.tree.find_best(
            max,
            |node, best| ray.entry_distance(node, best).unwrap_or(f64::MAX),
            |leaf, best| ray.intersect(&self.corners[leaf as usize], best),
        )?;
        let normal = scaled_normal(&self.corners[leaf as usize]).normalize();
        Some(Hit { distance, face: self.faces[leaf as usize], barycentric, normal })
    }

    fn occluded(&self, origin: &Point3<f64>, direction: &Vector3<f64>, max: f64) -> bool {
        let Some(ray) = ShearedRay::new(origin, direction) else { return false };
        let mut found = false;
        self.tree.traverse(|node| {
            if ray.entry_distance(node, max).is_none() {
                return TraversalAction::Prune;
            }
            found = node.leaf_data().is_some_and(|leaf| ray.intersect(&self.corners[leaf as usize], max).is_some());
            if found { TraversalAction::EarlyExit } else { TraversalAction::Continue }
        });
        found
    }

    fn distance(&self, point: &Point3<f64>, max: f64) -> f64 {
        self.nearest(point, max).map_or(max, |(_, distance)| distance.min(max))
    }
}

/// Normal of the triangle, twice its area long.
fn scaled_normal([a, b, c]: &[Vector3<f64>; 3]) -> Vector3<f64> {
    (b - a).cross(&(c - a))
}

fn vector(v: &Vector3<f64>) -> DVec3 {
    DVec3::new(v.x, v.y, v.z)
}

/// A ray in coordinates where it runs along the third axis: edge tests become 2D and exactly antisymmetric.
struct ShearedRay {
    origin: Vector3<f64>,
    axes: [usize; 3],
    shear: Vector3<f64>,
    /// One over the direction; huge instead of infinite, since zero times it must stay a number.
    inverse: Vector3<f64>,
}

impl ShearedRay {
    fn new(origin: &Point3<f64>, direction: &Vector3<f64>) -> Option<Self> {
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
    fn entry_distance(&self, node: &BvhNode, max: f64) -> Option<f64> {
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
    fn intersect(&self, triangle: &[Vector3<f64>; 3], max: f64) -> Option<(f64, [f64; 2])> {
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
