//! Rays that leave one point in nearly one direction: one search of the hierarchy finds the triangles that any of them may hit.

use glam::DVec3;
use nalgebra::{Point3, Vector3};
use parry3d_f64::partitioning::{Bvh, TraversalAction};

/// Of edge tests relative to the square of the distance: more than their rounding, so that no hit is lost.
pub(super) const MARGIN: f64 = 1e-9;

/// A pyramid around rays.
pub(super) struct Beam {
    origin: Vector3<f64>,
    /// Unit vectors: its axis, and two across.
    axis: Vector3<f64>,
    across: [Vector3<f64>; 2],
    /// Least and largest slopes along `across`.
    pub(super) low: [f64; 2],
    pub(super) high: [f64; 2],
    /// Normals, inwards, of its four sides, and its axis: the plane through the origin that it lies before.
    planes: [Vector3<f64>; 5],
}

impl Beam {
    /// The pyramid around rays from a point, wider by `margin` in slope; `None` where the cosine of an angle with their mean is smaller than
    /// `least_cosine`.
    pub(super) fn around(
        origin: &Point3<f64>,
        directions: impl Iterator<Item = Vector3<f64>> + Clone,
        least_cosine: f64,
        margin: f64,
    ) -> Option<Self> {
        let axis = directions.clone().sum::<Vector3<f64>>().try_normalize(0.1)?;
        // Along the rows of the picture, as its pixels come in that order: a pyramid askew to them would be wider.
        let mut ends = directions.clone();
        let (first, second) = (ends.next()?, ends.next()?);
        let row = second - first;
        let side = (row - axis * axis.dot(&row)).try_normalize(1e-12)?;
        let up = axis.cross(&side);
        let (low, high) = ([f64::MAX; 2], [f64::MIN; 2]);
        let mut beam = Self { origin: origin.coords, axis, across: [side, up], low, high, planes: [axis; 5] };
        for direction in directions {
            let along = direction.dot(&axis);
            if along.is_nan() || along < least_cosine {
                return None;
            }
            let slopes = beam.slopes(&direction);
            for (k, slope) in slopes.into_iter().enumerate() {
                (beam.low[k], beam.high[k]) = (beam.low[k].min(slope - margin), beam.high[k].max(slope + margin));
            }
        }
        let ([left, down], [right, top]) = (beam.low, beam.high);
        beam.planes = [side - axis * left, axis * right - side, up - axis * down, axis * top - up, axis];
        Some(beam)
    }

    /// How far a vector reaches along the axis.
    pub(super) fn depth(&self, vector: &Vector3<f64>) -> f64 {
        vector.dot(&self.axis)
    }

    /// How steeply a vector leaves the axis along the two directions across.
    pub(super) fn slopes(&self, vector: &Vector3<f64>) -> [f64; 2] {
        let inverse = 1.0 / self.depth(vector);
        self.across.map(|across| vector.dot(&across) * inverse)
    }

    /// The leaves whose boxes are not outside one of the planes; `None` if they are more than `most`.
    pub(super) fn leaves(&self, tree: &Bvh, most: usize) -> Option<Vec<u32>> {
        let (mut leaves, mut many) = (Vec::with_capacity(most), false);
        let (twice, sides) = (self.origin * 2.0, self.planes.map(|plane| (plane, plane.abs())));
        tree.traverse(|node| {
            // Twice the way to the middle of the box, and its size.
            let (middle, size) = (vector(node.mins() + node.maxs()) - twice, vector(node.maxs() - node.mins()));
            let outside = sides.iter().any(|(plane, across)| plane.dot(&middle) + across.dot(&size) < 0.0);
            if outside {
                return TraversalAction::Prune;
            }
            if let Some(leaf) = node.leaf_data() {
                leaves.push(leaf);
                many = leaves.len() > most;
            }
            if many { TraversalAction::EarlyExit } else { TraversalAction::Continue }
        });
        (!many).then_some(leaves)
    }
}

fn vector(v: DVec3) -> Vector3<f64> {
    Vector3::new(v.x, v.y, v.z)
}

/// A triangle that rays from one point may hit: the edge tests as planes through that point, which all rays share.
pub(super) struct Candidate {
    /// Its leaf.
    pub(super) leaf: u32,
    edges: [Vector3<f64>; 3],
    margin: f64,
}

impl Candidate {
    pub(super) fn new(leaf: u32, corners: &[Vector3<f64>; 3], origin: &Point3<f64>) -> Self {
        Self::seen(leaf, &corners.map(|corner| corner - origin.coords))
    }

    /// From the corners as seen from the point.
    pub(super) fn seen(leaf: u32, [a, b, c]: &[Vector3<f64>; 3]) -> Self {
        let farthest = a.norm_squared().max(b.norm_squared()).max(c.norm_squared());
        Self { leaf, edges: [c.cross(b), a.cross(c), b.cross(a)], margin: MARGIN * farthest }
    }

    /// Normal of the triangle, twice its area long.
    pub(super) fn normal(&self) -> Vector3<f64> {
        let [u, v, w] = self.edges;
        -(u + v + w)
    }

    /// Whether the line of a ray passes through the triangle, or by its edges within rounding.
    pub(super) fn may_be_hit(&self, direction: &Vector3<f64>) -> bool {
        let [u, v, w] = self.edges.map(|edge| edge.dot(direction));
        u.min(v).min(w) >= -self.margin || u.max(v).max(w) <= self.margin
    }
}
