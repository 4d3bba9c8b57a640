//! What is asked of the painted surface.

use nalgebra::{Point3, Vector3};

/// Where a ray meets a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Distance from the origin of the ray, m.
    pub distance: f64,
    /// Index of the triangle.
    pub face: u32,
    /// Weights of the triangle's second and third vertex; the first has `1 - a - b`.
    pub barycentric: [f64; 2],
    /// Geometric unit normal of the triangle by the right-hand rule of its vertices; it is not turned towards the ray.
    pub normal: Vector3<f64>,
}

/// A stretch of a ray that something may lie on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShadowRay {
    /// Where the ray begins, m.
    pub origin: Point3<f64>,
    /// Unit vector.
    pub direction: Vector3<f64>,
    /// Distance from the origin at which the stretch begins, m.
    pub from: f64,
    /// Length of the stretch, m; nothing lies on one that is not positive.
    pub length: f64,
}

impl ShadowRay {
    /// Where the stretch begins, m.
    pub fn start(&self) -> Point3<f64> {
        self.origin + self.direction * self.from
    }
}

/// What this crate needs to know of a surface. All points and vectors are in the world frame, in metres.
pub trait Surface: Sync {
    /// The first hit of the ray within `max` metres, from either side of the surface. `direction` has unit length.
    fn cast(&self, origin: &Point3<f64>, direction: &Vector3<f64>, max: f64) -> Option<Hit>;

    /// [`cast`](Self::cast) of rays that leave one point in nearly one direction, as those through neighbouring pixels do. Override it where
    /// such rays can share their search.
    fn cast_beam(&self, origin: &Point3<f64>, directions: &[Vector3<f64>], max: f64) -> Vec<Option<Hit>> {
        directions.iter().map(|direction| self.cast(origin, direction, max)).collect()
    }

    /// Whether anything lies on the ray before `max` metres. Override it where any hit is cheaper than the first one.
    fn occluded(&self, origin: &Point3<f64>, direction: &Vector3<f64>, max: f64) -> bool {
        self.cast(origin, direction, max).is_some()
    }

    /// [`occluded`](Self::occluded) of rays that leave one point: for each of them (unit direction, length in metres) whether anything lies on
    /// the stretch of that length which begins `from` metres from `origin`; never on one whose length is not positive. Override it where such
    /// rays can share their search; the answers must be those of each ray alone.
    fn occluded_beam(&self, origin: &Point3<f64>, from: f64, rays: &[(Vector3<f64>, f64)]) -> Vec<bool> {
        let occluded = |(direction, length): &(Vector3<f64>, f64)| {
            *length > 0.0 && self.occluded(&(origin + direction * from), direction, *length)
        };
        rays.iter().map(occluded).collect()
    }

    /// [`occluded`](Self::occluded) of rays in one direction, as those towards the sun are. Override it where they can share their search; the
    /// answers must be those of each ray alone.
    fn occluded_parallel(&self, origins: &[Point3<f64>], direction: &Vector3<f64>, max: f64) -> Vec<bool> {
        origins.iter().map(|origin| self.occluded(origin, direction, max)).collect()
    }

    /// [`occluded`](Self::occluded) of any rays. Override it where many of them cost less together; the answers must be those of each ray alone.
    fn occluded_each(&self, rays: &[ShadowRay]) -> Vec<bool> {
        rays.iter().map(|ray| ray.length > 0.0 && self.occluded(&ray.start(), &ray.direction, ray.length)).collect()
    }

    /// How many neighbouring rays are best asked for at once: as many as share their search.
    fn rays_at_once(&self) -> usize {
        256
    }

    /// Distance from `point` to the closest point of the surface, at most `max` (also returned when it is farther), m.
    fn distance(&self, point: &Point3<f64>, max: f64) -> f64;
}
