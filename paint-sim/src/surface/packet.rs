//! Rays that leave one point and search together for what each hits first.

use nalgebra::{Point3, Vector3};
use parry3d_f64::partitioning::Bvh;

use super::beam::Beam;
use super::projection::inverse_depth;
use super::ray_grid::{GridRay, RayGrid};
use super::sheared_ray::ShearedRay;

/// Rays whose angle with their mean has a smaller cosine (75 degrees) have slopes too steep for a picture.
const LEAST_COSINE: f64 = 0.25;
/// Of slopes: more than their rounding, so that no hit is lost.
const SLOPE_MARGIN: f64 = 1e-9;
/// With more triangles than this for each ray, a search for each ray costs less.
const MOST_LEAVES: usize = 4;
/// Fewer rays are not divided: it costs more than it saves.
const LEAST_HALF: usize = 64;

/// Leaf, distance, and barycentric weights of the second and third corner.
pub(super) type Found = (u32, f64, [f64; 2]);

/// Whether a triangle comes before what a ray has found: of equally near ones the first, in whatever order they are found.
pub(super) fn is_nearer(leaf: u32, distance: f64, max: f64, found: Option<&Found>) -> bool {
    match found {
        None => distance < max,
        Some((other, nearest, _)) => distance < *nearest || (distance == *nearest && leaf < *other),
    }
}

/// One of the rays, and its slopes.
struct Place {
    slopes: [f64; 2],
    ray: u32,
}

/// Rays from one point, and what they hit.
pub(super) struct RayPacket<'a> {
    pub(super) origin: &'a Point3<f64>,
    pub(super) directions: &'a [Vector3<f64>],
    pub(super) max: f64,
    pub(super) hits: Vec<Option<Found>>,
}

impl RayPacket<'_> {
    /// Finds the hits; `alone` casts a single ray.
    pub(super) fn cast(
        &mut self,
        tree: &Bvh,
        corners: &[[Vector3<f64>; 3]],
        alone: &dyn Fn(&Vector3<f64>) -> Option<Found>,
    ) {
        let Some((beam, slopes)) =
            Beam::around(self.origin, self.directions.iter().copied(), LEAST_COSINE, SLOPE_MARGIN)
        else {
            self.hits = self.directions.iter().map(alone).collect();
            return;
        };
        let most = MOST_LEAVES * self.directions.len();
        let leaves = beam.hull().leaves(tree, most);
        if leaves.as_ref().is_some_and(Vec::is_empty) {
            return;
        }
        let place = |(slopes, ray)| Place { slopes, ray };
        let mut places: Vec<Place> = slopes.into_iter().zip(0..).map(place).collect();
        let mut parts = vec![(beam, &mut places[..], leaves)];
        while let Some((beam, places, leaves)) = parts.pop() {
            if let Some(leaves) = leaves {
                self.cast_at(&leaves, corners, &beam, places);
            } else if places.len() >= 2 * LEAST_HALF {
                parts.extend(halves(&beam, places).map(|(beam, places)| {
                    let leaves = beam.hull().leaves(tree, MOST_LEAVES * places.len());
                    (beam, places, leaves)
                }));
            } else {
                for place in places {
                    self.hits[place.ray as usize] = alone(&self.directions[place.ray as usize]);
                }
            }
        }
    }

    /// Casts some of the rays at the triangles that are around them.
    fn cast_at(&mut self, leaves: &[u32], corners: &[[Vector3<f64>; 3]], beam: &Beam, places: &[Place]) {
        let side = RayGrid::side(places.len());
        let projection = beam.projection(side);
        let ray = |place: &Place| GridRay::new(projection.place(place.slopes), 0.0, place.ray);
        let rays: Vec<GridRay> = places.iter().map(ray).collect();
        let mut grid = RayGrid::new(side, &rays);
        grid.meet(&projection, leaves, corners, &mut |leaf, ray| {
            let (direction, hit) = (&self.directions[ray as usize], &mut self.hits[ray as usize]);
            let ray = ShearedRay::new(self.origin, direction)?;
            let (distance, weights) = ray.intersect(&corners[leaf as usize], self.max)?;
            if !is_nearer(leaf, distance, self.max, hit.as_ref()) {
                return None;
            }
            *hit = Some((leaf, distance, weights));
            Some(inverse_depth(distance * beam.depth(direction)))
        });
    }
}

/// Halves the rays along the wider side of their beam.
fn halves<'a>(beam: &Beam, places: &'a mut [Place]) -> [(Beam, &'a mut [Place]); 2] {
    let k = usize::from(beam.high[1] - beam.low[1] > beam.high[0] - beam.low[0]);
    let middle = places.len() / 2;
    places.select_nth_unstable_by(middle, |a, b| a.slopes[k].total_cmp(&b.slopes[k]).then(a.ray.cmp(&b.ray)));
    let (low, high) = places.split_at_mut(middle);
    [low, high].map(|half| (beam.around_slopes(half.iter().map(|place| place.slopes), SLOPE_MARGIN), half))
}
