//! Rays that leave one point in nearly one direction: one search of the hierarchy finds the triangles that any of them may hit.

use nalgebra::{Point3, Vector3};
use parry3d_f64::partitioning::{Bvh, TraversalAction};

/// Rays whose angle with their mean has a smaller cosine share too little.
const LEAST_COSINE: f64 = 0.9;
/// With more triangles than this a search for each ray costs less than a test of each ray with each of them.
const MOST_LEAVES: usize = 64;
/// Of slopes, and of edge tests relative to the square of the distance: more than their rounding, so that no hit is lost.
const MARGIN: f64 = 1e-9;

/// A pyramid around rays.
pub(super) struct Beam {
    origin: Vector3<f64>,
    /// Normals, inwards, of its four sides, and its axis: the plane through the origin that it lies before.
    planes: [Vector3<f64>; 5],
}

impl Beam {
    /// The pyramid around rays from a point; `None` where they diverge.
    pub(super) fn around(origin: &Point3<f64>, directions: &[Vector3<f64>]) -> Option<Self> {
        let [first, second, ..] = directions else { return None };
        let axis = directions.iter().sum::<Vector3<f64>>().try_normalize(0.1)?;
        // Along the rows of the picture, as its pixels come in that order: a pyramid askew to them would be wider.
        let row = second - first;
        let side = (row - axis * axis.dot(&row)).try_normalize(1e-12)?;
        let up = axis.cross(&side);
        let [mut low, mut high] = [[f64::MAX; 2], [f64::MIN; 2]];
        for direction in directions {
            let along = direction.dot(&axis);
            if along.is_nan() || along < LEAST_COSINE {
                return None;
            }
            for (k, across) in [side, up].iter().enumerate() {
                let slope = direction.dot(across) / along;
                (low[k], high[k]) = (low[k].min(slope - MARGIN), high[k].max(slope + MARGIN));
            }
        }
        let planes = [side - axis * low[0], axis * high[0] - side, up - axis * low[1], axis * high[1] - up, axis];
        Some(Self { origin: origin.coords, planes })
    }

    /// The leaves whose boxes are not outside one of the planes; `None` if they are many.
    pub(super) fn leaves(&self, tree: &Bvh) -> Option<Vec<u32>> {
        let (mut leaves, mut many) = (Vec::with_capacity(MOST_LEAVES), false);
        tree.traverse(|node| {
            let (low, high) = (node.mins(), node.maxs());
            let corners = [[low.x, high.x], [low.y, high.y], [low.z, high.z]];
            let outside = self.planes.iter().any(|plane| {
                // The corner that lies farthest inwards.
                let inwards = |i: usize| plane[i] * (corners[i][usize::from(plane[i] > 0.0)] - self.origin[i]);
                inwards(0) + inwards(1) + inwards(2) < 0.0
            });
            if outside {
                return TraversalAction::Prune;
            }
            if let Some(leaf) = node.leaf_data() {
                leaves.push(leaf);
                many = leaves.len() > MOST_LEAVES;
            }
            if many { TraversalAction::EarlyExit } else { TraversalAction::Continue }
        });
        (!many).then_some(leaves)
    }
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
        let [a, b, c] = corners.map(|corner| corner - origin.coords);
        let farthest = a.norm_squared().max(b.norm_squared()).max(c.norm_squared());
        Self { leaf, edges: [c.cross(&b), a.cross(&c), b.cross(&a)], margin: MARGIN * farthest }
    }

    /// Whether the line of a ray passes through the triangle, or by its edges within rounding.
    pub(super) fn may_be_hit(&self, direction: &Vector3<f64>) -> bool {
        let [u, v, w] = self.edges.map(|edge| edge.dot(direction));
        u.min(v).min(w) >= -self.margin || u.max(v).max(w) <= self.margin
    }
}
