//! The space around rays, and the triangles in it.

use glam::DVec3;
use nalgebra::Vector3;
use parry3d_f64::partitioning::{Bvh, TraversalAction};

/// What lies on the inner side of five planes: around rays, and before their start.
#[derive(Clone, Copy)]
pub(super) struct Hull {
    /// From which the distances of the planes count.
    pub(super) origin: Vector3<f64>,
    /// Normals, inwards, and what a point's product with them is at least.
    pub(super) planes: [(Vector3<f64>, f64); 5],
}

impl Hull {
    /// The leaves whose boxes are not outside one of the planes; `None` if they are more than `most`.
    pub(super) fn leaves(&self, tree: &Bvh, most: usize) -> Option<Vec<u32>> {
        let (mut leaves, mut many, mut inside) = (Vec::with_capacity(most), false, Vec::new());
        let (twice, sides) =
            (self.origin * 2.0, self.planes.map(|(normal, least)| (normal, normal.abs(), 2.0 * least)));
        tree.traverse_indexed(None, |node, index| {
            // Twice the way to the middle of the box, and its size.
            let (middle, size) = (vector(node.mins() + node.maxs()) - twice, vector(node.maxs() - node.mins()));
            let mut within = true;
            for (normal, across, least) in &sides {
                let (distance, reach) = (normal.dot(&middle) - least, across.dot(&size));
                if distance + reach < 0.0 {
                    return TraversalAction::Prune;
                }
                within &= distance >= reach;
            }
            if let Some(leaf) = node.leaf_data() {
                leaves.push(leaf);
            } else if within {
                // No box of the subtree needs another look.
                inside.push(index);
            }
            many = leaves.len() > most;
            match (many, within) {
                (true, _) => TraversalAction::EarlyExit,
                (_, true) => TraversalAction::Prune,
                _ => TraversalAction::Continue,
            }
        });
        for index in inside {
            tree.traverse_indexed(Some(index), |node, _| {
                leaves.extend(node.leaf_data());
                many |= leaves.len() > most;
                if many { TraversalAction::EarlyExit } else { TraversalAction::Continue }
            });
        }
        (!many).then_some(leaves)
    }
}

fn vector(v: DVec3) -> Vector3<f64> {
    Vector3::new(v.x, v.y, v.z)
}
