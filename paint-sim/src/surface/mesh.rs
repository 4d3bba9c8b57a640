//! A triangle mesh with a bounding volume hierarchy: the ready implementation of [`Surface`].

use std::cell::Cell;

use glam::DVec3;
use nalgebra::{Point3, Vector3};
use parry3d_f64::bounding_volume::Aabb;
use parry3d_f64::partitioning::{Bvh, BvhBuildStrategy, TraversalAction};
use parry3d_f64::query::PointQuery;
use parry3d_f64::shape::Triangle;

use super::packet::{Found, RayPacket, is_nearer};
use super::ray_query::{Hit, Surface};
use super::shadow_packet::Blockers;
use super::sheared_ray::{ShearedRay, SlabRay};
use crate::error::Error;

/// A triangle soup: open, unequal, duplicate and zero-area triangles are fine (the last are never hit).
///
/// No ray slips through an edge that two triangles share. Of triangles that a ray meets at the same distance it hits the first.
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
        let leaf = match self.faces.get(hit.face as usize) {
            // No triangle without an area is before it.
            Some(face) if *face == hit.face => hit.face as usize,
            _ => self.faces.binary_search(&hit.face).ok()?,
        };
        let [a, b, c] = &self.corners[leaf];
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

    /// The first triangle on a ray.
    fn first(&self, origin: &Point3<f64>, direction: &Vector3<f64>, max: f64) -> Option<Found> {
        let (ray, slabs) = (ShearedRay::new(origin, direction)?, SlabRay::new(origin, direction));
        let first: Cell<Option<Found>> = Cell::new(None);
        self.tree.find_best(
            max,
            // A box at the distance of the hit may hold one of the same distance.
            |node, nearest| slabs.entry_distance(node, nearest).map_or(f64::MAX, f64::next_down),
            |leaf, nearest| {
                let (distance, weights) = ray.intersect(&self.corners[leaf as usize], nearest)?;
                is_nearer(leaf, distance, max, first.get().as_ref())
                    .then(|| first.set(Some((leaf, distance, weights))))?;
                Some(distance)
            },
        );
        first.get()
    }

    /// The hit of one triangle, by its place among those that have an area: what [`cast`](Surface::cast) returns where it is the first one.
    #[cfg(feature = "gpu")]
    pub(super) fn cast_at(&self, leaf: u32, origin: &Point3<f64>, direction: &Vector3<f64>, max: f64) -> Option<Hit> {
        let (distance, weights) =
            ShearedRay::new(origin, direction)?.intersect(self.corners.get(leaf as usize)?, max)?;
        Some(self.hit((leaf, distance, weights)))
    }

    /// Corners of the triangles that have an area.
    #[cfg(feature = "gpu")]
    pub(super) fn corners(&self) -> &[[Vector3<f64>; 3]] {
        &self.corners
    }

    fn hit(&self, (leaf, distance, barycentric): Found) -> Hit {
        let normal = scaled_normal(&self.corners[leaf as usize]).normalize();
        Hit { distance, face: self.faces[leaf as usize], barycentric, normal }
    }

    /// Least and largest coordinate along an axis, m.
    pub fn extent(&self, axis: &Vector3<f64>) -> (f64, f64) {
        let along = self.corners.iter().flatten().map(|corner| corner.dot(axis));
        along.fold((f64::MAX, f64::MIN), |(low, high), a| (low.min(a), high.max(a)))
    }
}

impl Surface for TriangleSurface {
    fn cast(&self, origin: &Point3<f64>, direction: &Vector3<f64>, max: f64) -> Option<Hit> {
        self.first(origin, direction, max).map(|found| self.hit(found))
    }

    fn cast_beam(&self, origin: &Point3<f64>, directions: &[Vector3<f64>], max: f64) -> Vec<Option<Hit>> {
        let mut packet = RayPacket { origin, directions, max, hits: vec![None; directions.len()] };
        packet.cast(&self.tree, &self.corners, &|direction| self.first(origin, direction, max));
        packet.hits.into_iter().map(|found| found.map(|found| self.hit(found))).collect()
    }

    fn occluded(&self, origin: &Point3<f64>, direction: &Vector3<f64>, max: f64) -> bool {
        let Some(ray) = ShearedRay::new(origin, direction) else { return false };
        let slabs = SlabRay::new(origin, direction);
        let mut found = false;
        self.tree.traverse(|node| {
            if slabs.entry_distance(node, max).is_none() {
                return TraversalAction::Prune;
            }
            found = node.leaf_data().is_some_and(|leaf| ray.intersect(&self.corners[leaf as usize], max).is_some());
            if found { TraversalAction::EarlyExit } else { TraversalAction::Continue }
        });
        found
    }

    fn occluded_beam(&self, origin: &Point3<f64>, from: f64, rays: &[(Vector3<f64>, f64)]) -> Vec<bool> {
        let blockers = Blockers { tree: &self.tree, corners: &self.corners };
        blockers.dark_from(origin, from, rays).unwrap_or_else(|| {
            let occluded = |(direction, length): &(Vector3<f64>, f64)| {
                *length > 0.0 && self.occluded(&(origin + direction * from), direction, *length)
            };
            rays.iter().map(occluded).collect()
        })
    }

    fn occluded_parallel(&self, origins: &[Point3<f64>], direction: &Vector3<f64>, max: f64) -> Vec<bool> {
        let blockers = Blockers { tree: &self.tree, corners: &self.corners };
        blockers
            .dark_beside(origins, direction, max)
            .unwrap_or_else(|| origins.iter().map(|origin| self.occluded(origin, direction, max)).collect())
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
