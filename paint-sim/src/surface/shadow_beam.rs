//! Shadow rays from one point: what proves that most of them are free without a search for each.
//!
//! The triangles around the rays are sorted into a grid over the slopes, and a ray is compared with those in its cell alone. Nearly always it
//! ends before their planes or passes by their edges; only where neither is certain the hierarchy has to be asked.

use nalgebra::{Point3, Vector3};
use parry3d_f64::partitioning::Bvh;

use super::beam::{Beam, Candidate, MARGIN};

/// Rays farther than this from their mean (80 degrees) have slopes too steep for a grid.
const LEAST_COSINE: f64 = 0.17;
/// Of slopes: far more than rounding, far less than a cell.
const SLOPE_MARGIN: f64 = 1e-6;
/// Distance of the world's origin, relative to the stretch that the rays skip, up to which their starts are rounded by less than the margins.
const FARTHEST: f64 = 1e5;
/// Cells along a side of the grid: about as many as a spot has texels across.
const SIDE: usize = 16;
/// Fewer rays are better searched for one by one.
const FEWEST_RAYS: usize = 8;
/// The end of a list.
const END: u32 = u32::MAX;

/// The triangles that rays from one point may hit, by slope.
pub(super) struct ShadowBeam {
    beam: Beam,
    /// Cells per unit of slope.
    scale: [f64; 2],
    blockers: Vec<Blocker>,
    /// First entry of each cell's list.
    heads: [u32; SIDE * SIDE],
    /// A blocker, and the next entry of the same cell.
    entries: Vec<(u32, u32)>,
}

/// A triangle with the plane that it lies in.
struct Blocker {
    edges: Candidate,
    /// Normal of the plane, away from the point that the rays leave; twice the triangle's area long.
    normal: Vector3<f64>,
    /// A point whose product with the normal is less lies before the plane for certain.
    height: f64,
}

impl ShadowBeam {
    /// `None` where the rays are few or diverge, where more triangles than rays are around them, or where rounding leaves doubts.
    pub(super) fn around(
        origin: &Point3<f64>,
        from: f64,
        rays: &[(Vector3<f64>, f64)],
        tree: &Bvh,
        corners: &[[Vector3<f64>; 3]],
    ) -> Option<Self> {
        if rays.len() < FEWEST_RAYS || (from > 0.0 && origin.coords.amax() > FARTHEST * from) {
            return None;
        }
        let beam = Beam::around(origin, rays.iter().map(|ray| ray.0), LEAST_COSINE, SLOPE_MARGIN)?;
        let leaves = beam.leaves(tree, rays.len())?;
        let reach = rays.iter().map(|ray| from + ray.1).fold(0.0, f64::max);
        let scale = [0, 1].map(|k| SIDE as f64 / (beam.high[k] - beam.low[k]));
        let (blockers, entries) = (Vec::with_capacity(leaves.len()), Vec::with_capacity(8 * leaves.len()));
        let mut sorted = Self { beam, scale, blockers, heads: [END; SIDE * SIDE], entries };
        for leaf in leaves {
            let corners = corners[leaf as usize].map(|corner| corner - origin.coords);
            let farthest = corners.iter().map(Vector3::norm_squared).fold(reach * reach, f64::max).sqrt();
            sorted.insert(Blocker::new(leaf, &corners, farthest)?, &corners, farthest);
        }
        Some(sorted)
    }

    /// Puts a triangle, its corners seen from the origin, into the lists of the cells that it may cover.
    fn insert(&mut self, blocker: Blocker, corners: &[Vector3<f64>; 3], farthest: f64) {
        let (mut low, mut high) = ([f64::MAX; 2], [f64::MIN; 2]);
        for corner in corners {
            if self.beam.depth(corner) <= SLOPE_MARGIN * farthest {
                // Beside or behind the origin the slopes mean nothing: it may cover every cell.
                (low, high) = (self.beam.low, self.beam.high);
                break;
            }
            let slopes = self.beam.slopes(corner);
            for k in 0..2 {
                (low[k], high[k]) = (low[k].min(slopes[k] - SLOPE_MARGIN), high[k].max(slopes[k] + SLOPE_MARGIN));
            }
        }
        if (0..2).any(|k| high[k] < self.beam.low[k] || low[k] > self.beam.high[k]) {
            return;
        }
        let ([left, down], [right, top]) = (self.cell(&low), self.cell(&high));
        for row in down..=top {
            for head in &mut self.heads[row * SIDE + left..=row * SIDE + right] {
                self.entries.push((self.blockers.len() as u32, *head));
                *head = self.entries.len() as u32 - 1;
            }
        }
        self.blockers.push(blocker);
    }

    /// Column and row; the cells at the rim take what lies beyond.
    fn cell(&self, slopes: &[f64; 2]) -> [usize; 2] {
        [0, 1].map(|k| (((slopes[k] - self.beam.low[k]) * self.scale[k]) as usize).min(SIDE - 1))
    }

    /// Whether nothing lies on a ray before `end` metres, for certain.
    pub(super) fn is_free(&self, direction: &Vector3<f64>, end: f64) -> bool {
        let [column, row] = self.cell(&self.beam.slopes(direction));
        let mut entry = self.heads[row * SIDE + column];
        while entry != END {
            let (blocker, next) = self.entries[entry as usize];
            let Blocker { edges, normal, height } = &self.blockers[blocker as usize];
            if normal.dot(direction) * end >= *height && edges.may_be_hit(direction) {
                return false;
            }
            entry = next;
        }
        true
    }
}

impl Blocker {
    /// `None` of a triangle that is seen edge-on, of which rounding alone may make a hit.
    fn new(leaf: u32, corners: &[Vector3<f64>; 3], farthest: f64) -> Option<Self> {
        let edges = Candidate::seen(leaf, corners);
        let (normal, margin) = (edges.normal(), MARGIN * farthest.powi(3));
        let height = normal.dot(&corners[0]);
        let (normal, height) = (normal * height.signum(), height.abs());
        (height > 2.0 * margin).then_some(Self { edges, normal, height: height - margin })
    }
}
