//! The cone that holds all droplets of a nozzle.

use nalgebra::{Point3, Vector3};

use super::directions::Droplets;
use super::sweep::Nozzle;

/// The cone around a set of droplets, in the world.
pub(super) struct Cone {
    origin: Point3<f64>,
    axis: Vector3<f64>,
    slope: f64,
    cosine: f64,
    range: f64,
}

impl Cone {
    pub(super) fn new(nozzle: &Nozzle, droplets: &Droplets) -> Self {
        let slope = droplets.slope;
        Self {
            origin: nozzle.origin,
            axis: nozzle.axis.into_inner(),
            slope,
            cosine: 1.0 / (1.0 + slope * slope).sqrt(),
            range: droplets.range,
        }
    }

    /// Whether a ball may touch the cone; never false when it does.
    pub(super) fn may_touch(&self, center: &Point3<f64>, radius: f64) -> bool {
        let ray = center - self.origin;
        let depth = ray.dot(&self.axis);
        if depth < -radius || depth > self.range + radius {
            return false;
        }
        let sideways = (ray - self.axis * depth).norm();
        (sideways - self.slope * depth) * self.cosine <= radius
    }
}
