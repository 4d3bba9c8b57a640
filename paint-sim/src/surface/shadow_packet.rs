//! Shadow rays that search together: from one point, or side by side towards the sun.

use nalgebra::{Point3, Vector3};
use parry3d_f64::partitioning::Bvh;

use super::beam::Beam;
use super::hull::Hull;
use super::projection::{Projection, inverse_depth};
use super::ray_grid::{GridRay, RayGrid};
use super::sheared_ray::ShearedRay;

/// Rays farther than this from their mean (80 degrees) have slopes too steep for a picture.
const LEAST_COSINE: f64 = 0.17;
/// Of slopes: far more than rounding, far less than a cell.
const SLOPE_MARGIN: f64 = 1e-6;
/// Narrower beams, in slope, are not magnified so far that rounding shows.
const LEAST_WIDTH: f64 = 1e-4;
/// Distance of the world's origin, relative to the stretch that the rays skip, up to which their starts are rounded by less than the margins.
const FARTHEST: f64 = 1e5;
/// Of lengths across parallel rays, relative to the width of them all and to the distance of the world's origin: more than their rounding.
const LENGTH_MARGIN: [f64; 2] = [1e-9, 1e-13];
/// Fewer rays are better searched for one by one.
const FEWEST_RAYS: usize = 8;
/// With more triangles than this for each ray as well.
const MOST_LEAVES: usize = 4;
/// A limit that nothing passes: of rays that are known to be dark, or have no length.
const NEVER: f32 = f32::MAX;

/// Triangles with the tree that finds them.
#[derive(Clone, Copy)]
pub(super) struct Blockers<'a> {
    pub(super) tree: &'a Bvh,
    pub(super) corners: &'a [[Vector3<f64>; 3]],
}

impl Blockers<'_> {
    /// Which of the rays from a point (unit direction, length) are occluded after the first `from` metres. `None` where they are few or
    /// diverge, where far more triangles than rays are around them, or where rounding leaves doubts.
    pub(super) fn dark_from(&self, origin: &Point3<f64>, from: f64, rays: &[(Vector3<f64>, f64)]) -> Option<Vec<bool>> {
        if rays.len() < FEWEST_RAYS || (from > 0.0 && origin.coords.amax() > FARTHEST * from) {
            return None;
        }
        let (beam, slopes) = Beam::around(origin, rays.iter().map(|ray| ray.0), LEAST_COSINE, SLOPE_MARGIN)?;
        if (0..2).any(|k| beam.high[k] - beam.low[k] < LEAST_WIDTH) {
            return None;
        }
        let leaves = beam.hull().leaves(self.tree, MOST_LEAVES * rays.len())?;
        let side = RayGrid::side(rays.len());
        let projection = beam.projection(side);
        let place = |ray: usize| {
            let (direction, length) = &rays[ray];
            let end = (from + length) * beam.depth(direction);
            let limit = if *length > 0.0 { inverse_depth(end) } else { NEVER };
            GridRay::new(projection.place(slopes[ray]), limit, ray as u32)
        };
        let grid = RayGrid::new(side, &(0..rays.len()).map(place).collect::<Vec<_>>());
        let ray = |ray: u32| {
            let (direction, length) = rays[ray as usize];
            (origin + direction * from, direction, length)
        };
        Some(self.dark(&leaves, grid, &projection, ray))
    }

    /// The same of rays in one direction. `None` where they are few, or far more triangles than rays are around them.
    pub(super) fn dark_beside(&self, origins: &[Point3<f64>], direction: &Vector3<f64>, max: f64) -> Option<Vec<bool>> {
        let ([first, second, ..], axis) = (origins, direction.try_normalize(0.1)?) else { return None };
        if origins.len() < FEWEST_RAYS {
            return None;
        }
        let row = second - first;
        let side = (row - axis * axis.dot(&row)).try_normalize(1e-12)?;
        let frame = [side, axis.cross(&side), axis];
        let places = origins.iter().map(|origin| frame.map(|v| v.dot(&(origin - first))));
        let (mut low, mut high) = ([f64::MAX; 3], [f64::MIN; 3]);
        for place in places.clone() {
            for k in 0..3 {
                if !place[k].is_finite() {
                    return None;
                }
                (low[k], high[k]) = (low[k].min(place[k]), high[k].max(place[k]));
            }
        }
        let width = (0..3).map(|k| high[k] - low[k]).fold(0.0, f64::max);
        let margin = LENGTH_MARGIN[0] * width + LENGTH_MARGIN[1] * first.coords.amax();
        let (low, high) = (low.map(|v| v - margin), high.map(|v| v + margin));
        let [side, up, _] = frame;
        let planes = [(side, low[0]), (-side, -high[0]), (up, low[1]), (-up, -high[1]), (axis, low[2])];
        let leaves = Hull { origin: first.coords, planes }.leaves(self.tree, MOST_LEAVES * origins.len())?;
        let cells = RayGrid::side(origins.len());
        let projection = Projection::parallel(first.coords, frame, [low, high], cells);
        let place = |([x, y, along], ray): ([f64; 3], u32)| GridRay::new(projection.place([x, y]), along as f32, ray);
        let grid = RayGrid::new(cells, &places.zip(0..).map(place).collect::<Vec<_>>());
        Some(self.dark(&leaves, grid, &projection, |ray| (origins[ray as usize], *direction, max)))
    }

    /// Asks each ray that may meet a triangle whether it does.
    fn dark(
        &self,
        leaves: &[u32],
        mut grid: RayGrid,
        projection: &Projection,
        ray: impl Fn(u32) -> (Point3<f64>, Vector3<f64>, f64),
    ) -> Vec<bool> {
        let mut dark = vec![false; grid.len()];
        grid.meet(projection, leaves, self.corners, &mut |leaf, index| {
            let (start, direction, length) = ray(index);
            ShearedRay::new(&start, &direction)?.intersect(&self.corners[leaf as usize], length)?;
            dark[index as usize] = true;
            Some(NEVER)
        });
        dark
    }
}
