//! A triangle mesh with a bounding volume hierarchy: the ready implementation of [`Surface`].

use nalgebra::{Point3, Vector3};
use parry3d_f64::bounding_volume::Aabb;
use parry3d_f64::math::Vector;
use parry3d_f64::partitioning::{Bvh, BvhBuildStrategy};
use parry3d_f64::query::{PointQuery, Ray};
use parry3d_f64::shape::Triangle;

use super::{Hit, Surface};
use crate::Error;

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
}

impl Surface for TriangleSurface {
    fn cast(&self, origin: &Point3<f64>, direction: &Vector3<f64>, max: f64) -> Option<Hit> {
        let ray = Ray::new(vector(&origin.coords), vector(direction));
        let sheared = ShearedRay::new(origin, direction)?;
        let (leaf, (distance, barycentric)) = self.tree.find_best(
            max,
            |node, best| node.cast_ray(&ray, best),
            |leaf, best| sheared.meet(&self.corners[leaf as usize], best),
        )?;
        let normal = scaled_normal(&self.corners[leaf as usize]).normalize();
        Some(Hit { distance, face: self.faces[leaf as usize], barycentric, normal })
    }

    fn occluded(&self, origin: &Point3<f64>, direction: &Vector3<f64>, max: f64) -> bool {
        let ray = Ray::new(vector(&origin.coords), vector(direction));
        let Some(sheared) = ShearedRay::new(origin, direction) else { return false };
        // A cost of zero for any hit leaves nothing to improve, so the search ends with the first one.
        let any = self.tree.find_best(
            max,
            |node, best| if best > 0.0 { node.cast_ray(&ray, max) } else { f64::MAX },
            |leaf, _| sheared.meet(&self.corners[leaf as usize], max).map(|_| 0.0),
        );
        any.is_some()
    }

    fn distance(&self, point: &Point3<f64>, max: f64) -> f64 {
        let query = vector(&point.coords);
        let closest = self.tree.find_best(
            max,
            |node, _| node.aabb().distance_to_local_point(query, true),
            |leaf, _| {
                let [a, b, c] = &self.corners[leaf as usize];
                let triangle = Triangle::new(vector(a), vector(b), vector(c));
                Some((triangle.project_local_point(query, true).point - query).length())
            },
        );
        closest.map_or(max, |(_, distance)| distance.min(max))
    }
}

/// Normal of the triangle, twice its area long.
fn scaled_normal([a, b, c]: &[Vector3<f64>; 3]) -> Vector3<f64> {
    (b - a).cross(&(c - a))
}

fn vector(v: &Vector3<f64>) -> Vector {
    Vector::new(v.x, v.y, v.z)
}

/// A ray in coordinates where it runs along the third axis: edge tests become 2D and exactly antisymmetric.
struct ShearedRay {
    origin: Vector3<f64>,
    axes: [usize; 3],
    shear: Vector3<f64>,
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
        Some(Self { origin: origin.coords, axes, shear })
    }

    /// Distance and barycentric weights of the second and third corner, where the ray meets the triangle before `max`.
    fn meet(&self, triangle: &[Vector3<f64>; 3], max: f64) -> Option<(f64, [f64; 2])> {
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
