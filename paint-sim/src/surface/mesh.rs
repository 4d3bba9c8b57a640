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
    corners: Vec<[Vector3<f64>; 3]>,
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
        let mut corners = Vec::with_capacity(faces.len());
        for (face, vertices) in faces.iter().enumerate() {
            let mut triangle = [Vector3::zeros(); 3];
            for (corner, &vertex) in triangle.iter_mut().zip(vertices) {
                let position = positions.get(vertex as usize).ok_or(Error::VertexIndex {
                    face,
                    vertex,
                    vertices: positions.len(),
                })?;
                *corner = Vector3::from(position.map(f64::from));
            }
            corners.push(triangle);
        }
        // Rounding in the box test must never cost a hit that the triangle test would find.
        let largest = corners.iter().flatten().map(nalgebra::Matrix::amax).fold(0.0, f64::max);
        let margin = largest * 1e-12;
        let solid = |t: &[Vector3<f64>; 3]| (t[1] - t[0]).cross(&(t[2] - t[0])).norm_squared() > 0.0;
        let boxes = corners.iter().enumerate().filter(|(_, t)| solid(t)).map(|(i, t)| {
            let low = t[0].inf(&t[1]).inf(&t[2]).add_scalar(-margin);
            let high = t[0].sup(&t[1]).sup(&t[2]).add_scalar(margin);
            (i, Aabb::new(vector(&low), vector(&high)))
        });
        let tree = Bvh::from_iter(BvhBuildStrategy::Binned, boxes);
        if tree.is_empty() {
            return Err(Error::NoArea { faces: faces.len() });
        }
        Ok(Self { corners, tree })
    }

    /// Number of triangles, those of zero area included.
    pub fn len(&self) -> usize {
        self.corners.len()
    }

    /// Whether there is no triangle; never true for a surface that `new` returned.
    pub fn is_empty(&self) -> bool {
        self.corners.is_empty()
    }

    /// The three corners of a triangle, or `None` where there is no such face.
    pub fn triangle(&self, face: u32) -> Option<[Point3<f64>; 3]> {
        self.corners.get(face as usize).map(|t| t.map(Point3::from))
    }
}

impl Surface for TriangleSurface {
    fn cast(&self, origin: &Point3<f64>, direction: &Vector3<f64>, max: f64) -> Option<Hit> {
        let ray = Ray::new(vector(&origin.coords), vector(direction));
        let sheared = ShearedRay::new(origin, direction)?;
        let (face, (distance, barycentric)) = self.tree.find_best(
            max,
            |node, best| node.cast_ray(&ray, best),
            |face, best| sheared.meet(&self.corners[face as usize], best),
        )?;
        let [a, b, c] = &self.corners[face as usize];
        Some(Hit { distance, face, barycentric, normal: (b - a).cross(&(c - a)).normalize() })
    }

    fn occluded(&self, origin: &Point3<f64>, direction: &Vector3<f64>, max: f64) -> bool {
        let ray = Ray::new(vector(&origin.coords), vector(direction));
        let Some(sheared) = ShearedRay::new(origin, direction) else { return false };
        // A cost of zero for any hit leaves nothing to improve, so the search ends with the first one.
        let any = self.tree.find_best(
            max,
            |node, best| if best > 0.0 { node.cast_ray(&ray, max) } else { f64::MAX },
            |face, _| sheared.meet(&self.corners[face as usize], max).map(|_| 0.0),
        );
        any.is_some()
    }

    fn distance(&self, point: &Point3<f64>, max: f64) -> f64 {
        let query = vector(&point.coords);
        let closest = self.tree.find_best(
            max,
            |node, _| node.aabb().distance_to_local_point(query, true),
            |face, _| {
                let [a, b, c] = &self.corners[face as usize];
                let triangle = Triangle::new(vector(a), vector(b), vector(c));
                Some((triangle.project_local_point(query, true).point - query).length())
            },
        );
        closest.map_or(max, |(_, distance)| distance.min(max))
    }
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
