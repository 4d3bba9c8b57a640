//! A bounding-ball tree over the texels: which of them can one spray cone reach?

use std::ops::Range;

use nalgebra::{Point3, Vector3};

use super::texel::Texel;
use crate::spray::Cone;

/// Texels per leaf: small enough that few outside the cone are looked at, large enough that the tree stays small.
pub(super) const LEAF: usize = 16;

/// Binary tree of balls over a permutation of the texels; the two children of a node follow one another.
#[derive(Debug)]
pub(super) struct BallTree {
    order: Vec<u32>,
    nodes: Vec<Node>,
}

#[derive(Debug, Clone, Copy)]
struct Node {
    center: Point3<f64>,
    radius: f64,
    start: u32,
    end: u32,
    /// Index of the first child; zero marks a leaf, since the root is nobody's child.
    children: u32,
}

impl BallTree {
    pub(super) fn new(texels: &[Texel]) -> Self {
        let mut order: Vec<u32> = (0..texels.len() as u32).collect();
        let mut nodes = vec![ball(texels, &order, 0)];
        let mut next = 0;
        while next < nodes.len() {
            let Node { start, end, .. } = nodes[next];
            let range = &mut order[start as usize..end as usize];
            if range.len() > LEAF {
                let axis = widest_axis(texels, range);
                let half = range.len() / 2;
                let key = |&i: &u32| texels[i as usize].point[axis];
                range.select_nth_unstable_by(half, |a, b| key(a).total_cmp(&key(b)).then(a.cmp(b)));
                let (low, high) = range.split_at(half);
                let children = [ball(texels, low, start), ball(texels, high, start + half as u32)];
                nodes[next].children = nodes.len() as u32;
                nodes.extend(children);
            }
            next += 1;
        }
        Self { order, nodes }
    }

    /// Calls `visit` with every texel that the cone may touch, in an order that depends on the texels alone.
    pub(super) fn for_each(&self, cone: &Cone, stack: &mut Vec<u32>, mut visit: impl FnMut(u32)) {
        self.for_each_leaf(cone, stack, |leaf| self.order[leaf].iter().for_each(|&i| visit(i)));
    }

    /// The same, leaf by leaf: where its texels stand in the order.
    pub(super) fn for_each_leaf(&self, cone: &Cone, stack: &mut Vec<u32>, mut visit: impl FnMut(Range<usize>)) {
        stack.clear();
        stack.push(0);
        while let Some(index) = stack.pop() {
            let node = &self.nodes[index as usize];
            if !cone.may_intersect(&node.center, node.radius) {
                continue;
            }
            if node.children == 0 {
                visit(node.start as usize..node.end as usize);
            } else {
                stack.extend([node.children + 1, node.children]);
            }
        }
    }

    /// Where the texels of all leaves stand, from first to last.
    #[cfg(feature = "gpu")]
    pub(super) fn leaves(&self) -> Vec<Range<usize>> {
        let leaves = self.nodes.iter().filter(|node| node.children == 0);
        let mut leaves: Vec<_> = leaves.map(|node| node.start as usize..node.end as usize).collect();
        leaves.sort_unstable_by_key(|leaf| leaf.start);
        leaves
    }

    /// The texels, leaf after leaf.
    #[cfg(feature = "gpu")]
    pub(super) fn order(&self) -> &[u32] {
        &self.order
    }
}

fn bounds(texels: &[Texel], range: &[u32]) -> (Vector3<f64>, Vector3<f64>) {
    let start = texels[range[0] as usize].point.coords;
    range.iter().fold((start, start), |(low, high), &i| {
        let point = &texels[i as usize].point.coords;
        (low.inf(point), high.sup(point))
    })
}

fn widest_axis(texels: &[Texel], range: &[u32]) -> usize {
    let (low, high) = bounds(texels, range);
    (high - low).imax()
}

/// The ball around the centre of the bounding box that holds the texels with their extent (half the diagonal of a square).
fn ball(texels: &[Texel], range: &[u32], start: u32) -> Node {
    let (low, high) = bounds(texels, range);
    let center = Point3::from((low + high) * 0.5);
    let reach = |&i: &u32| {
        let texel = &texels[i as usize];
        (texel.point - center).norm() + (0.5 * texel.area).sqrt()
    };
    let radius = range.iter().map(reach).fold(0.0, f64::max);
    Node { center, radius, start, end: start + range.len() as u32, children: 0 }
}
