//! Triangles as rays on a GPU search them: a tree of boxes in single precision.

use nalgebra::Vector3;

/// Triangles of a leaf.
const LEAF: usize = 4;
/// Words of a node: low corner and the node after its subtree; high corner, and first triangle times eight with their number.
const NODE: usize = 8;

/// A tree in depth-first order, so that a ray needs no stack: the next node is the one behind it, or behind its subtree.
pub(super) struct GpuTree {
    pub(super) nodes: Vec<u32>,
    /// Three corners with one more word each, the first of which is the triangle's number.
    pub(super) triangles: Vec<u32>,
    /// Where coordinates begin: so that all corners, which come in single precision, have it still.
    pub(super) origin: Vector3<f64>,
    /// Largest coordinate from there, m.
    pub(super) size: f64,
    /// Largest coordinate in the world, m.
    pub(super) farthest: f64,
}

impl GpuTree {
    pub(super) fn new(corners: &[[Vector3<f64>; 3]]) -> Self {
        let first = corners[0][0];
        let bounds =
            |(low, high): (Vector3<f64>, Vector3<f64>), corner: &Vector3<f64>| (low.inf(corner), high.sup(corner));
        let (low, high) = corners.iter().flatten().fold((first, first), bounds);
        // The difference of two numbers of which none is more than twice the other is exact (Sterbenz 1974).
        let origin = low.zip_map(&high, |low, high| match (low, high) {
            _ if low > 0.0 && high <= 2.0 * low => low,
            _ if high < 0.0 && low >= 2.0 * high => high,
            _ => 0.0,
        });
        let mut tree = Self {
            nodes: Vec::new(),
            triangles: Vec::with_capacity(12 * corners.len()),
            origin,
            size: (low - origin).amax().max((high - origin).amax()),
            farthest: low.amax().max(high.amax()),
        };
        let boxed: Vec<[[f32; 3]; 3]> =
            corners.iter().map(|corners| corners.map(|corner| (corner - origin).map(|v| v as f32).into())).collect();
        let mut order: Vec<u32> = (0..corners.len() as u32).collect();
        tree.add(&boxed, &mut order);
        tree
    }

    fn add(&mut self, corners: &[[[f32; 3]; 3]], order: &mut [u32]) {
        let of = |triangle: &u32| corners[*triangle as usize];
        let (mut low, mut high) = ([f32::MAX; 3], [f32::MIN; 3]);
        for corner in order.iter().flat_map(of) {
            low = std::array::from_fn(|k| low[k].min(corner[k]));
            high = std::array::from_fn(|k| high[k].max(corner[k]));
        }
        let at = self.nodes.len();
        let [low_words, high_words] = [low, high].map(|corner| corner.map(f32::to_bits));
        self.nodes.extend(low_words.into_iter().chain([0]).chain(high_words).chain([0]));
        if order.len() <= LEAF {
            self.nodes[at + 7] = (self.triangles.len() / 12 * 8 + order.len()) as u32;
            for triangle in order.iter() {
                for (corner, number) in of(triangle).into_iter().zip([*triangle, 0, 0]) {
                    self.triangles.extend(corner.map(f32::to_bits).into_iter().chain([number]));
                }
            }
        } else {
            let wide = (1..3).fold(0, |most, k| if high[k] - low[k] > high[most] - low[most] { k } else { most });
            let key = |triangle: &u32| of(triangle).iter().map(|corner| corner[wide]).sum::<f32>();
            let half = order.len() / 2;
            order.select_nth_unstable_by(half, |a, b| key(a).total_cmp(&key(b)).then(a.cmp(b)));
            let (left, right) = order.split_at_mut(half);
            self.add(corners, left);
            self.add(corners, right);
        }
        self.nodes[at + 3] = (self.nodes.len() / NODE) as u32;
    }
}
